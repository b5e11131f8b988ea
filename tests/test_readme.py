"""Every command of the README exists, and its Python example runs."""

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


COMMANDS = [line for block in blocks("sh") for line in block.splitlines() if line.strip()]


def test_the_two_commands_come_first():
    assert COMMANDS[:2] == ["make demo", "make test"]


@pytest.mark.parametrize("command", COMMANDS)
def test_command_exists(command, tmp_path):
    program, *words = command.removeprefix(".venv/bin/").split()
    if program == "make":
        if shutil.which("make") is None:
            pytest.skip("make is not installed")
        check = ["make", "--dry-run", *words]
    elif program == "texgs":
        check = [sys.executable, "-m", "texgs.cli.main", words[0], "--help"]
    elif program == "snakemake":
        words = [*shlex.split(command)[1:], "--dry-run", "--directory", str(tmp_path)]
        check = [sys.executable, "-m", "snakemake", "--snakefile", str(ROOT / "Snakefile"), *words]
    elif program == "mlflow":
        check = [sys.executable, "-m", "mlflow", words[0], "--help"]
    else:
        assert words[:2] == ["install", "."], f"{command}: not covered by this test"
        check = [sys.executable, "-m", "pip", "install", "--help"]
    done = subprocess.run(check, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_pictures_exist():
    pictures = re.findall(r"!\[.*?\]\((.*?)\)", README)
    assert pictures
    for picture in pictures:
        assert (ROOT / picture).is_file(), f"{picture} is missing"


def test_python_example_runs(tmp_path):
    (example,) = blocks("python")
    assert len(example.splitlines()) <= 20
    done = subprocess.run([sys.executable, "-c", example], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "surfels.png").stat().st_size > 10_000
