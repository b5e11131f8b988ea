"""The wheel works without the source tree: built from the sdist, installed alone, run in an empty folder."""

import os
import subprocess
import sys
import sysconfig
import tarfile
import venv
from pathlib import Path

import pytest

from tests.workflow.project import TINY

pytestmark = pytest.mark.packaging

ROOT = Path(__file__).parents[1]
SDIST = "import sys; from scikit_build_core.build import build_sdist; print(build_sdist(sys.argv[1]))"
SHORT = "fit.seeds.count=300 fit.shading.iterations=30 edits=[gold] ~dataset.basic_tfs.TF02 tracking=none"


def run(*words, cwd, **environment):
    """A command that must succeed; what it prints."""
    clean = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "TEXGS"))}
    done = subprocess.run(
        list(map(str, words)), cwd=cwd, env={**clean, **environment}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def sdist(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sdist")
    return folder / run(sys.executable, "-c", SDIST, folder, cwd=ROOT).splitlines()[-1]


@pytest.fixture(scope="module")
def texgs(sdist, tmp_path_factory):
    """The installed command. Packages that texgs needs are those of the Python that runs this test."""
    folder = tmp_path_factory.mktemp("wheel")
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--no-input"]
    # The last two compile in a fraction of the time.
    settings = ("define.TEXGS_CUDA=OFF", "build-type=Debug", "define.CMAKE_CXX_FLAGS_DEBUG=-O0")
    options = ["--no-deps", "--no-build-isolation", *(f"--config-settings=cmake.{each}" for each in settings)]
    run(*pip, "wheel", sdist, *options, "--wheel-dir", folder, cwd=folder)
    (wheel,) = folder.glob("*.whl")
    venv.create(folder / "venv", with_pip=False)
    python = folder / "venv" / "bin" / "python"
    run(*pip, "--python", python, "install", "--no-deps", "--no-index", wheel, cwd=folder)
    where = "import sysconfig; print(sysconfig.get_path('purelib'))"
    packages = Path(run(python, "-c", where, cwd=folder).strip())
    (packages / "dependencies.pth").write_text(f"{sysconfig.get_path('purelib')}\n")
    return folder / "venv" / "bin" / "texgs"


@pytest.fixture(scope="module")
def project(texgs, tmp_path_factory):
    folder = tmp_path_factory.mktemp("empty")
    run(texgs, "init", "mine", cwd=folder)
    return folder / "mine"


def test_the_sdist_holds_the_workflow(sdist):
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert {"Snakefile", "conf/config.yaml", "workflow/rules/stages.smk", "pyproject.toml"} <= names
    assert "benchmarks/results/index.csv" in names
    assert {f"workflow/profiles/{name}/profile.yaml" for name in ("local", "slurm")} <= names


def test_the_viewer_brings_its_page(texgs):
    (page,) = texgs.parents[1].rglob("viewer/web/page.html")
    assert {path.name for path in page.parent.iterdir()} == {
        path.name for path in (ROOT / "texgs" / "viewer" / "web").iterdir()
    }


def test_the_doctor_finds_what_it_needs(texgs, project):
    said = run(texgs, "doctor", cwd=project)
    assert str(texgs.parents[1]) in said
    assert str(ROOT / "texgs") not in said


def test_a_volume_of_the_user_goes_to_the_project(texgs, project):
    code = "import numpy; numpy.save('scan.npy', numpy.indices((16, 16, 16)).sum(0).astype('float32'))"
    run(sys.executable, "-c", code, cwd=project)
    assert "then: texgs run dataset=scan" in run(texgs, "new", "scan.npy", "up=+z", cwd=project)
    assert (project / "conf" / "dataset" / "scan.yaml").exists()
    assert not list(texgs.parents[1].rglob("scan.yaml"))
    said = run(texgs, "run", "-n", "dataset=scan", "fit=quick", cwd=project)
    assert "report" in said


def test_the_demo_from_the_volume_to_the_report(texgs, project):
    words = ["run", "experiment=demo", *TINY.split(), *SHORT.split()]
    said = run(texgs, *words, cwd=project, OMP_NUM_THREADS="1")
    assert "Done: results/report.html" in said
    assert "texgs view results/orbital/scene/demo/compose/scene.yaml" in said
    assert (project / "results" / "report.html").stat().st_size > 10_000
    again = run(texgs, *words, cwd=project)
    assert "Done" not in again, "a second time there is nothing to do"
