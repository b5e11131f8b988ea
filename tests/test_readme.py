"""Every command of the README runs, on a small volume and few iterations, and so does its Python example."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import nibabel
import numpy as np
import pytest
import pyvista

from tests.workflow.project import LAUNCHER, Project

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
SMALL = (
    "views=small views.width=32 views.height=32 views.train.frequency=1 views.test.count=2 views.turntable=2 "
    "fit.seeds.count=300 fit.shading.iterations=30 tracking=none"
)
FILMS = "--width 32 --height 32 --frames 3"


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


COMMANDS = [line for block in blocks("sh") for line in block.splitlines() if line.strip()]


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """Copied sources, for `texgs new` writes there, and small volumes with the names that the README has."""
    found = Project(tmp_path_factory.mktemp("readme"), native=True)
    axes = np.meshgrid(*[np.linspace(-1, 1, 24)] * 3, indexing="ij")
    values = (255 * np.clip(1.2 - np.linalg.norm(axes, axis=0), 0, 1)).astype(np.uint8)
    grid = pyvista.ImageData(dimensions=values.shape)
    grid.point_data["ImageScalars"] = values.ravel(order="F")
    grid.save(found.work / "engine.vti")
    nibabel.save(nibabel.Nifti1Image(values, np.eye(4)), found.work / "scan.nii.gz")
    return found


def test_the_two_commands_come_first():
    assert COMMANDS[:2] == ["make demo", "make test"]


def checked(command):
    """The command as this test runs it: in this Python, small, without server, download or installation."""
    program, *words = shlex.split(command.removeprefix(".venv/bin/"))
    python = [sys.executable, "-c", LAUNCHER, "SOURCES"]
    if program == "make":
        return ["make", "--directory", str(ROOT), "--dry-run", *words]
    if program == "texgs":
        if any(word.startswith("dataset=") for word in words):
            words += SMALL.split() if words[0] != "views" else SMALL.split()[1:]
        if words[0] == "render":
            words = [word for word in words if word not in ("--width", "1200")]
            words += FILMS.split() if "--path" in words else FILMS.split()[:4]
        return [*python, "texgs.cli.main", *words]
    if program == "snakemake":
        settings = words.index("--config")
        where = ["--snakefile", "SOURCES/Snakefile", "--dry-run", "--executor", "local", "--cores", "1"]
        return [*python, "snakemake.cli", *words[:settings], *where, *words[settings:]]
    if program == "mlflow":
        return [sys.executable, "-m", "mlflow", words[0], "--help"]
    assert words[:2] == ["install", "."], f"{command}: not covered by this test"
    return [sys.executable, "-m", "pip", "install", "--help"]


@pytest.mark.parametrize("command", COMMANDS)
def test_command_runs(command, project):
    """In their order: later ones use what earlier ones wrote."""
    if command.startswith("make") and shutil.which("make") is None:
        pytest.skip("make is not installed")
    if "--kind mesh" in command:
        pytest.importorskip("open3d")
    words = [word.replace("SOURCES", str(project.sources)) for word in checked(command)]
    environment = {**os.environ, "TEXGS_DATA": str(project.work), "OMP_NUM_THREADS": "2"}
    done = subprocess.run(words, cwd=project.work, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


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
