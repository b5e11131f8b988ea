"""The way from a volume to the report, once with few iterations: what is planned, done and not done again."""

import shutil
from pathlib import Path

import pytest

from tests.workflow.project import Project

pytestmark = pytest.mark.workflow

STAGE = Path(__file__).parents[1] / "toys" / "projection.py"  # one file, as a user would add it

SMALL = (
    "fit.seeds.count=200 fit.shading.iterations=12 fit.shading.densify.stop=10 "
    "edits=[glass] edit.image.iterations=2"
)
RUN: dict = {"targets": (), "config": ("tracking=none", "dataset=sphere", "fit=demo"), "overrides": SMALL}


def test_from_the_volume_to_the_report(tmp_path):
    project = Project(tmp_path)
    shutil.copy(STAGE, project.sources / "texgs" / "workflow" / "stages")
    planned = project.planned(**RUN)
    assert {"volume", "projection", "views TF01", "phase TF01", "compose", "edit"} <= set(planned)
    done = project.snakemake(**RUN)
    assert done.returncode == 0, done.stdout + done.stderr
    results = project.work / "results"
    assert (results / "sphere" / "projection" / "projection.png").exists()
    assert "Largest sample along z." in (results / "report.html").read_text()
    assert len((results / "tables" / "fitting.csv").read_text().splitlines()) > 1
    assert (results / "sphere" / "scene" / "demo" / "edits" / "glass" / "scene.yaml").exists()
    assert project.planned(**RUN) == []
