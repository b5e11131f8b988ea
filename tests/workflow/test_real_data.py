"""The workflow on real volumes, in views of 48 x 48 pixels: every basic TF of theirs shows something."""

import json

import pytest

from tests.real_data import FOLDER, real_data
from tests.workflow.project import Project
from texgs.volume.view_set import read_views

pytestmark = pytest.mark.workflow

FILES = {"engine": "engine.vti", "hydrogen": "hydrogen.vti", "frog": "frog.mhd"}
SMALL = (
    "dataset.volume.generator=null views.width=48 views.height=48 "
    "views.train.frequency=1 views.test.count=2 views.turntable=2"
)


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """One run with all that are there."""
    project = Project(tmp_path_factory.mktemp("project"))
    volumes = FOLDER / "volumes"
    names = [name for name, file in FILES.items() if (volumes / file).exists()]
    overrides = f"{SMALL} datasets=[{','.join(names)}] data_folder={volumes}"
    views = [f"results/{name}/{tf}/views/metrics.json" for name in names for tf in ("TF01", "TF02")]
    done = project.snakemake(targets=("volumes", *views), overrides=overrides)
    assert done.returncode == 0, done.stdout + done.stderr
    return project.work / "results"


@pytest.mark.parametrize("name", FILES)
def test_every_view_shows_something(request, name):
    real_data(f"volumes/{FILES[name]}")
    folder = request.getfixturevalue("results") / name
    assert (folder / "transfer" / "transfer.png").exists()
    tfs = sorted(path for path in folder.glob("TF*"))
    assert len(tfs) == 2
    for tf in tfs:
        views = read_views(tf / "views")
        assert (len(views.train), len(views.test)) == (12, 2)
        assert all(view.load()[..., 3].max() > 0 for view in (*views.train, *views.test))
        numbers = json.loads((tf / "views" / "metrics.json").read_text())["numbers"]
        assert (numbers["width"], numbers["height"], len(numbers["frames_ms"])) == (48, 48, 12 + 2 + 2 - 1)
