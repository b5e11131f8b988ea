"""A small project that several files start from: views of a sphere, and a scene of an orbital."""

import json
import shutil

import pytest

from texgs.cli.main import main

VIEWS = [
    "dataset.volume.size=32",
    "views=small",
    "views.width=48",
    "views.height=48",
    "views.train.frequency=1",
    "views.test.count=3",
    "views.relit=3",
    "views.turntable=2",
    "views.radius=2.5",
    "tracking=none",
]
DEMO = ["fit=demo", "fit.seeds.count=400", "fit.shading.densify.stop=0"]
SPHERE = ["dataset=sphere", *VIEWS]
TINY = [*SPHERE, *DEMO, "fit.shading.iterations=150"]
ORBITAL = ["dataset=orbital", "dataset.stand_in=vortex", *VIEWS, *DEMO, "fit.shading.iterations=60"]
GAUSSIANS = [
    "fit=gaussians_quick",
    "fit.gaussians.seeds={kind: hull, count: 400}",
    "fit.gaussians.iterations=150",
    "fit.gaussians.sh_every=10",
    "fit.gaussians.densify.stop=0",
]


@pytest.fixture(scope="session")
def at(tmp_path_factory):
    """Runs verbs one after the other in a folder of their own, without weights."""

    def run(folder, *verbs):
        with pytest.MonkeyPatch.context() as patch:
            patch.chdir(folder)
            hide_weights(patch, folder)
            # Frames of palette fields take long.
            patch.setattr("texgs.report.before_after.TURNTABLE_FRAMES", 4)
            for words in verbs:
                assert main(words) == 0
        return folder / "results"

    return run


@pytest.fixture(scope="session")
def sphere(at, tmp_path_factory):
    """Results with views of a sphere."""
    return at(tmp_path_factory.mktemp("sphere"), ["views", *SPHERE])


@pytest.fixture(scope="session")
def fitted_sphere(at, sphere, tmp_path_factory):
    """The same with a fit of surfels in three phases."""
    return at(copied(sphere, tmp_path_factory.mktemp("fitted")), ["texture", *TINY])


@pytest.fixture(scope="session")
def gaussians(at, sphere, tmp_path_factory):
    """The same with a scene of 3D Gaussians."""
    return at(copied(sphere, tmp_path_factory.mktemp("gaussians")), ["compose", *SPHERE, *GAUSSIANS])


@pytest.fixture(scope="session")
def scene_of_two(at, tmp_path_factory):
    """Results with a scene of two models of an orbital."""
    return at(tmp_path_factory.mktemp("orbital"), ["compose", *ORBITAL])


def numbers(folder):
    """Return what a job has measured, of its folder."""
    return json.loads((folder / "metrics.json").read_text())["numbers"]


def hide_weights(patch, folder):
    """Let no pretrained weights be found."""
    for name in ("TEXGS_WEIGHTS", "TORCH_HOME", "HF_HOME", "XDG_CACHE_HOME"):
        patch.setenv(name, str(folder / "none"))


def copied(results, folder):
    """Copy results into another folder; return that."""
    shutil.copytree(results, folder / "results", symlinks=True)
    return folder
