"""The lock files hold every package that the Makefile installs: exact versions, and hashes of all files."""

import re
import tomllib
from pathlib import Path

import pytest

from tools.licences import HEADER as HEADER_OF_LICENCES
from tools.licences import table
from tools.lock import EXTRAS, HEADER, TORCH_FILE, without_torch

ROOT = Path(__file__).parents[1]
LOCK = (ROOT / "requirements.lock").read_text(encoding="utf-8")
ENTRY = re.compile(r"([a-z0-9-]+)==[\w.]+(?: ; [^\\\n]+)?(?: \\\n    --hash=sha256:[0-9a-f]{64})+\n")


def test_every_package_has_an_exact_version_and_hashes():
    assert LOCK.startswith(HEADER)
    assert ENTRY.sub("", LOCK.removeprefix(HEADER)) == ""


def test_everything_asked_for_is_locked():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    asked = [*project["dependencies"], *(line for extra in EXTRAS for line in extras[extra])]
    names = {re.match(r"[\w-]+", line).group().lower() for line in asked}
    assert names - set(ENTRY.findall(LOCK)) == {"torch"}
    lines = (ROOT / TORCH_FILE).read_text(encoding="utf-8").splitlines()
    (pinned,) = (line for line in lines if not line.startswith("#"))
    assert re.fullmatch(r"torch==[\d.]+", pinned)


@pytest.mark.parametrize("name", ["Dockerfile", "environment.yml"])
def test_other_ways_to_install_take_the_same_torch_and_a_python_that_texgs_has(name):
    text, locked = (ROOT / name).read_text(encoding="utf-8"), (ROOT / TORCH_FILE).read_text(encoding="utf-8")
    assert re.findall(r"torch==[\d.]+", text) == re.findall(r"^torch==[\d.]+", locked, flags=re.MULTILINE)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    lowest, above = (int(minor) for minor in re.findall(r"3\.(\d+)", project["requires-python"]))
    versions = {int(minor) for minor in re.findall(r"python[:=]3\.(\d+)", text)}
    assert versions
    assert all(lowest <= minor < above for minor in versions)


def test_licences_are_those_of_all_packages_that_are_installed():
    page = (ROOT / "docs" / "licences.md").read_text(encoding="utf-8").removeprefix(HEADER_OF_LICENCES)
    assert by_package(table()).items() <= by_package(page).items()


def by_package(rows):
    parts = [row.strip("| ").split(" | ") for row in rows.splitlines()]
    return {name: licence for licence, names in parts for name in names.split(", ")}


def test_torch_and_its_cuda_libraries_are_left_out():
    kept = "torchmetrics==1.0 \\\n    --hash=sha256:aa\n"
    cuda = "nvidia-cublas==13.1 ; sys_platform == 'linux' \\\n    --hash=sha256:bb \\\n    --hash=sha256:cc\n"
    torch = "torch==2.13.0 \\\n    --hash=sha256:dd\n"
    assert without_torch(cuda + kept + torch + cuda) == kept
