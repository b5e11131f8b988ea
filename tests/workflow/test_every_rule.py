"""Every rule of the workflow, from the volume to the report, run by Snakemake: once, and after changes."""

import html
import json
import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest

from tests.workflow.project import Project
from texgs.volume import generate
from texgs.volume.grid import Grid
from texgs.volume.prepare import prepare
from texgs.volume.slabs import ArraySource

pytestmark = pytest.mark.workflow

# A method, a field and a stage that are one file each, as a user would add them.
TOYS = Path(__file__).parents[1] / "toys"
PLACES = {"fade": "edit/methods", "ball": "fields/kinds", "projection": "workflow/stages"}
BALL = "defaults: [default]\nname: ball\nfield: ball\nball: {radius: 0.45}\n"
# A segment of the only model, an edit of it alone, and an edit by the method of the toys.
EDITS = {
    "fade": "name: fade\nmethod: fade\nfade: {opacity: 0.6}\n",
    "piece": "name: piece\nmethod: segment\n"
    "segment: {model: TF01, name: piece, points: [[0.5, 0.5]], masks: grabcut, views: 12, size: 64}\n",
    "red": "name: red\nmethod: text\nbase: piece\nparts: [TF01/piece]\n"
    "text: {instruction: make it crimson, guidance: filters}\n",
}
SWEEP = "name: tiny\nvariants:\n  few: [fit.seeds.count=150]\n"
SMALL = (
    "dataset.volume.generator=null dataset.volume.file=0.nrrd dataset.series=[*.nrrd] data_folder=. "
    "fit.seeds.count=200 fit.surfels.iterations=4 fit.shading.iterations=12 fit.shading.densify.stop=10 "
    "fits=[demo,ball] edits=[glass,piece,red,fade] edit.image.iterations=2 "
    "mesh.tfs=[TF01] +sweeps.tiny=sphere"
)
OPTIONS: dict = {"targets": (), "config": ("tracking=none", "dataset=sphere", "fit=demo"), "overrides": SMALL}

FITS = {"surfels", "shading", "texture"}  # all by the rule `phase`
AFTER_FITS = {
    *("figure", "comparison", "mesh", "compose", "steps", "pse", "timing", "page"),
    *("edit", "edit_metrics", "gallery"),
}
TABLES = {"tables", "report"}
RULES = {"volume", "transfer", "projection", "views", "sheet", "ball"} | FITS | AFTER_FITS | TABLES
GROUPS = {  # only names
    *("all", "volumes", "sheets", "figures", "fits", "comparisons", "meshes", "scenes", "edits", "galleries"),
    "phase",
}


def changed(project, extra=""):
    """Rules that a dry run would run, without those that only name others."""
    return run(project, extra, "--dry-run")


def run(project, extra="", *words):
    """Rules that ran, phases of fits by their own names, without rules that only name others."""
    done = project.snakemake(*words, **{**OPTIONS, "overrides": f"{SMALL} {extra}"})
    assert done.returncode == 0, done.stdout + done.stderr
    blocks = re.split(r"^(?:local)?rule (?=\w+:)", done.stdout + done.stderr, flags=re.MULTILINE)[1:]
    rules = {block.partition(":")[0] for block in blocks}
    phases = {phase for block in blocks for phase in re.findall(r"wildcards: .*\bphase=(\w+)", block)}
    return {*rules, *phases} - GROUPS


def metrics(project):
    """What all jobs say about themselves, their times included: a job that ran again says something else."""
    results = project.work / "results"
    return {
        path.parent.relative_to(results).as_posix(): path.read_text()
        for path in results.rglob("metrics.json")
    }


def made_again(before, after):
    return {folder for folder in before | after if before.get(folder) != after.get(folder)}


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    project = Project(tmp_path_factory.mktemp("every"))
    for toy, folder in PLACES.items():
        shutil.copy(TOYS / f"{toy}.py", project.sources / "texgs" / folder)
    for name, text in EDITS.items():
        (project.sources / "conf" / "edit" / f"{name}.yaml").write_text(text)
    (project.sources / "conf" / "sweep" / "tiny.yaml").write_text(SWEEP)
    (project.sources / "conf" / "fit" / "ball.yaml").write_text(BALL)
    # So short a fit is far from the surface, where each point's search for the nearest takes long.
    project.edit("texgs/workflow/stages/mesh.py", "MEASURED = 200_000", "MEASURED = 2_000")
    orbital = generate.orbital(24)
    for step in range(2):  # of a series in time
        moved = Grid(np.roll(orbital.values, step, axis=2), orbital.spacing)
        prepare(ArraySource(moved, "made"), project.work / f"{step}.nrrd")
    assert run(project) == RULES
    return project


@pytest.fixture
def sources(project):
    """The project, whose sources are put back after the test."""
    edited = {}

    def edit(name, old, new):
        path = project.sources / name
        edited.setdefault(path, path.read_text())
        project.edit(name, old, new)

    yield edit
    for path, text in edited.items():
        path.write_text(text)


def test_every_result_is_there_and_recorded(project):
    results = project.work / "results"
    of_surfels, of_ball, of_sweep = 5 + 4 + 4 + 3, 2 + 3 + 2, 3
    pages = 4  # of surfels as fitted, and of their three looks
    side_by_side = 2  # comparison and gallery
    of_volume = 6  # the volume, its TFs, its projection, a sheet, and views under many lights and under one
    assert len(metrics(project)) == of_volume + of_surfels + pages + of_ball + of_sweep + side_by_side
    for name in ("fitting", "datasets", "rendering", "model_size", "edits", "looks", "meshes", "sweep-tiny"):
        assert len((results / "tables" / f"{name}.csv").read_text().splitlines()) > 1
        assert f"fitted{{{name}.tex}}" in (results / "tables" / "tables.tex").read_text()
    assert "red" in (results / "tables" / "looks.md").read_text()
    assert (results / "report.html").stat().st_size > 10_000
    shading = json.loads((results / "sphere" / "TF01" / "demo" / "shading" / "metrics.json").read_text())
    assert {"inputs", "versions", "machine", "code_sha"} <= set(shading)
    assert set(shading["inputs"]) == {"model", "views", "volume"}
    assert {"torch", "vtk", "opencv-python-headless"} <= set(shading["versions"])
    assert {"threads", "torch_blas", "texgs_cpu"} <= set(shading["machine"])
    assert not list(results.rglob(".*.work"))
    assert not list(results.rglob(".*.old"))


def test_a_method_a_field_and_a_stage_of_one_file_each_are_in_tables_and_report(project):
    results = project.work / "results"
    rows = {
        name: (results / "tables" / f"{name}.csv").read_text().splitlines()
        for name in ("fitting", "rendering", "model_size", "edits", "looks")
    }
    for name, lines in rows.items():
        assert any(",ball," in line for line in lines), f"{name} has a row of the fit `ball`"
    faded = [line for line in rows["looks"] if ',fade,"fade: a toy, opacity of ' in line]
    assert {line.split(",")[1] for line in faded} == {"demo", "ball"}, "both fields can fade"
    assert sum(",glass," in line for line in rows["looks"]) == 1, "a ball has no texture"
    report = (results / "report.html").read_text()
    assert "<b>ball fade</b>" in report
    assert "<b>TF01 ball</b>" in report
    assert (results / "sphere" / "projection" / "projection.png").exists()
    assert "Largest sample along z." in report
    compared = json.loads((results / "sphere" / "TF01" / "comparison" / "looks" / "metrics.json").read_text())
    assert compared["numbers"]["recipes"] == ["demo", "ball"]
    assert compared["pictures"]["comparison.png"] in report
    words = ("edit_fade", "dataset=sphere", "fit=ball", "edit=glass", "tracking=none")
    assert "edit.method: expected fade, got image (edit=glass)" in project.texgs(*words).stderr
    refused = project.texgs("edit_image", "dataset=sphere", "fit=ball", "edit=glass", "tracking=none")
    message = "edit glass: expected a fit of surfels, got one of ball, which has no relight, texture"
    assert message in refused.stderr


def test_the_commands_below_figures_do_nothing_where_all_is_done(project):
    commands = re.findall(r"<code>texgs (.*?)</code>", (project.work / "results" / "report.html").read_text())
    commands = sorted({html.unescape(command) for command in commands})
    assert {command.split()[0] for command in commands} >= {"sheet", "figure", "pse", "edit_image", "gallery"}
    before = metrics(project)
    for command in commands:
        assert "up to date" in project.typed(*shlex.split(command)).stdout, command
    assert metrics(project) == before
    other = project.typed("sheet", "dataset=sphere", "tracking=none")
    assert (other.returncode, "--replace" in other.stderr) == (2, True)
    assert metrics(project) == before


def test_a_second_time_there_is_nothing_to_do(project):
    assert changed(project) == set()


def test_a_changed_value_runs_what_reads_it(project):
    assert changed(project, "fit.texture.sweeps=2") == {"texture"} | AFTER_FITS | TABLES
    assert changed(project, "metric.views=3") == {"edit_metrics", "tables", "report"}


def test_a_changed_line_runs_the_stages_that_import_it(project, sources):
    old = "from math import ceil\n"
    sources("texgs/report/fit_figure.py", old, f"{old}\nCHANGED = True\n")
    pictures = {"figure", "comparison", "gallery", "mesh", "pse", "tables", "report"}
    pictures |= {"steps", "edit", "edit_metrics", "page"}  # steps are pictured as `pse` does, and edited then
    assert changed(project) == pictures
    sources("texgs/config/recipes.py", '"seed of random numbers', '"seed of all random numbers')
    assert changed(project) == pictures, "help texts do not count"


def test_changed_native_sources_run_what_calls_them_and_want_a_new_library(project, sources):
    sources("texgs/raster/csrc/maths.h", "// SPDX", "// One more comment. SPDX")
    assert changed(project) == set()
    sources("texgs/raster/csrc/maths.h", "#pragma once", "#pragma once\n#define CHANGED 1")
    planned = changed(project)
    assert planned >= FITS | AFTER_FITS | TABLES
    assert "volume" not in planned
    before = metrics(project)
    failed = project.snakemake(**OPTIONS)
    assert failed.returncode != 0
    assert "compile them with `make install`" in failed.stdout + failed.stderr
    assert made_again(before, metrics(project)) <= {"sphere/TF01/views", "sphere/TF01/sheet"}


def test_sources_that_are_put_back_want_the_results_of_before(project):
    run(project)  # views were rendered by the other sources before a fit wanted a new library
    assert changed(project) == set()


def test_what_is_damaged_is_made_again_and_nothing_else(project):
    """A view cut short, a model removed, one cut short, and one with a flipped bit: each at once."""
    folder = project.work / "results" / "sphere" / "TF01"
    image, other = folder / "views" / "train" / "r_0003.png", folder / "views" / "train" / "r_0004.png"
    models = [folder / "demo" / phase / "model.safetensors" for phase in ("surfels", "shading", "texture")]
    whole = {path: path.read_bytes() for path in (image, *models)}
    written, before = other.stat().st_mtime_ns, metrics(project)
    removed, cut, flipped = models
    removed.unlink()
    for path in (image, cut):
        path.write_bytes(whole[path][: len(whole[path]) // 2])
    flipped.write_bytes(whole[flipped][:-1] + bytes([whole[flipped][-1] ^ 1]))
    run(project)
    assert {path: path.read_bytes() for path in whole} == whole
    assert other.stat().st_mtime_ns == written, "the other views are those of before"
    phases = {f"sphere/TF01/demo/{path.parent.name}" for path in models}
    assert made_again(before, metrics(project)) == {"sphere/TF01/views", *phases}
    assert changed(project) == set()


def test_a_truncated_report_and_a_changed_table_are_made_again(project):
    results = project.work / "results"
    for path, rule in ((results / "report.html", "report"), (results / "tables" / "fitting.csv", "tables")):
        whole = path.read_bytes()
        path.write_bytes(whole[: len(whole) // 2])
        assert changed(project) == {rule}
        run(project)
        assert len(path.read_bytes()) == len(whole)
    assert changed(project) == set()


def test_what_was_made_by_hand_is_not_made_again(project):
    done = project.texgs(
        "figure", "dataset=sphere", "fit=demo", "tracking=none", "variant=hand", *SMALL.split()
    )
    assert done.returncode == 0, done.stderr
    before = metrics(project)
    assert "sphere/TF01/demo-hand/figure" in before
    options = {**OPTIONS, "targets": ("figures",), "overrides": f"{SMALL} variant=hand edits=[]"}
    done = project.snakemake(**options)
    assert done.returncode == 0, done.stdout + done.stderr
    made = made_again(before, metrics(project))
    assert "sphere/TF01/ball-hand/figure" in made
    assert not {folder for folder in made if "demo-hand" in folder}
