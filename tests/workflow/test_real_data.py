"""The workflow on real volumes, in views of 48 x 48 pixels: every basic TF of theirs shows something."""

import pytest

from tests.real_data import FOLDER, real_data
from tests.workflow.project import Project
from texgs.volume.view_set import read_views

pytestmark = pytest.mark.workflow

FILES = {"engine": "engine.vti", "hydrogen": "hydrogen.vti", "frog": "frog.mhd"}
TFS = {"frog": ("liver", "skeleton")}
SMALL = (
    "dataset.volume.generator=null views.width=48 views.height=48 "
    "views.train.frequency=1 views.test.count=2 views.turntable=2"
)


@pytest.mark.parametrize("name", FILES)
def test_every_view_shows_something(tmp_path, name):
    real_data(f"volumes/{FILES[name]}")
    project = Project(tmp_path)
    overrides = f"{SMALL} datasets=[{name}] data_folder={FOLDER / 'volumes'}"
    folders = [project.work / "results" / name / tf / "views" for tf in TFS.get(name, ("TF01", "TF02"))]
    targets = [f"results/{name}/{folder.parent.name}/views/metrics.json" for folder in folders]
    done = project.snakemake(targets=(*targets, "volumes"), overrides=overrides)
    assert done.returncode == 0, done.stdout + done.stderr
    for views in map(read_views, folders):
        assert (len(views.train), len(views.test)) == (12, 2)
        assert all(view.load()[..., 3].max() > 0 for view in (*views.train, *views.test))
