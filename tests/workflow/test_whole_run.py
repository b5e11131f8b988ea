"""The way from a volume to the report, once with few iterations: what is planned, done and not done again."""

from tests.workflow.project import Project

SMALL = (
    "fit.seeds.count=200 fit.shading.iterations=12 fit.shading.densify.stop=10 "
    "edits=[glass] edit.image.iterations=2"
)
RUN: dict = {"targets": (), "config": ("tracking=none", "dataset=sphere", "fit=demo"), "overrides": SMALL}


def test_from_the_volume_to_the_report(tmp_path):
    project = Project(tmp_path)
    planned = project.planned(**RUN)
    assert {"volume", "views TF01", "phase TF01", "compose", "edit"} <= set(planned)
    done = project.snakemake(**RUN)
    assert done.returncode == 0, done.stdout + done.stderr
    results = project.work / "results"
    assert (results / "report.html").stat().st_size > 10_000
    assert len((results / "tables" / "fitting.csv").read_text().splitlines()) > 1
    assert (results / "sphere" / "scene" / "demo" / "edits" / "glass" / "scene.yaml").exists()
    assert project.planned(**RUN) == []
