"""A function that is kept gets views, a model and its place in the scene; nothing else is fitted anew."""

import json
import re
from dataclasses import replace

import pytest

from tests.workflow.project import Project
from texgs.cli.main import main
from texgs.scene.scene_file import read_scene, write_scene
from texgs.volume.transfer import TransferFunction

pytestmark = pytest.mark.workflow

DATA_SET = """\
name: mine  # a ring around lobes
volume: {generator: orbital}
tf_values: fraction
basic_tfs:
  TF01:
    opacity: [[0.38, 0.0], [0.41, 0.04], [0.44, 0.04], [0.45, 0.0]]
    color: [[0.38, 0.65, 0.3, 0.75]]
  TF02: # opaque
    opacity: [[0.55, 0.0], [0.57, 0.8], [0.8, 0.9]]
    color: [[0.55, 0.15, 0.65, 0.6]]
"""
FAINT = TransferFunction(((0.49, 0), (0.5, 0.3), (0.51, 0)), ((0.5, 0.2, 0.9, 0.1),))  # out to all sides
RUN: dict = {
    "targets": ("volumes", "results/mine/scene/demo/compose/metrics.json"),
    "config": ("tracking=none", "dataset=mine", "fit=demo"),
    "overrides": "fit.seeds.count=200 fit.shading.iterations=12 fit.shading.densify.stop=10",
}


def run(project):
    done = project.snakemake(**RUN)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


def times(folder):
    """When the files of jobs were written."""
    return {path.relative_to(folder): path.stat().st_mtime_ns for path in folder.rglob("*") if path.is_file()}


def cameras(views):
    whole = json.loads((views / "transforms_train.json").read_text())
    return [whole["fl_x"], *(frame["transform_matrix"] for frame in whole["frames"])]


def test_the_workflow_makes_the_views_the_model_and_the_scene_of_what_is_kept(tmp_path, monkeypatch, capsys):
    project = Project(tmp_path)
    file = project.work / "conf" / "dataset" / "mine.yaml"
    file.parent.mkdir(parents=True)
    file.write_text(DATA_SET)
    run(project)
    results = project.work / "results" / "mine"
    before, scene = times(results), read_scene(results / "scene" / "demo" / "compose" / "scene.yaml")
    write_scene(project.work / "tried.yaml", replace(scene, functions={"TF03": FAINT}))
    monkeypatch.chdir(project.work)
    assert main(["model", "tried.yaml", "TF03", "--keep"]) == 0
    assert re.search(r"dataset=mine\. It reaches 0\.\d+ out of the frame of", capsys.readouterr().out)
    assert project.planned(**RUN) == ["compose", *["phase TF03"] * 3, "transfer", "views TF03"]
    log = run(project)
    assert re.findall(r"^basic TF mine/\w+ reaches", log, flags=re.MULTILINE) == [
        "basic TF mine/TF03 reaches"
    ]
    after = times(results)
    changed = {path.parts[0] for path, time in before.items() if after.get(path) != time}
    assert changed == {"transfer", "scene"}
    assert {path.parts[0] for path in after.keys() - before.keys()} == {"TF03", "transfer"}
    assert cameras(results / "TF03" / "views") == cameras(results / "TF01" / "views")
    made = read_scene(results / "scene" / "demo" / "compose" / "scene.yaml")
    assert (list(made.models), made.frame) == (["TF01", "TF02", "TF03"], scene.frame)
    assert project.planned(**RUN) == []
