"""What the tracking store and the metrics file are told of a job."""

import json
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from texgs.config.case import Case
from texgs.core.cache import Checksums
from texgs.report.results import (
    EditResult,
    FitResult,
    GalleryResult,
    PseResult,
    Shown,
    ViewComparison,
    as_mapping,
)
from texgs.workflow.job import Job
from texgs.workflow.provenance import device, seed
from texgs.workflow.runs import PARENT
from texgs.workflow.stage_table import STAGES
from texgs.workflow.sweep import as_sweep, variants
from texgs.workflow.tracked import RUNS, Tracking, curves, flatten, name, of_workflow, scalars, tags

GOLD = ("edit=gold", "edit.text.size=64,128")
IDENTITY = {"settings": "0123", "code": "4567"}


def job(stage, words, tf=None):
    """The job of the last variant of some words."""
    config = variants(Case(as_sweep(("dataset=sphere", "fit=demo", *words))))[-1].config
    return Job.of(STAGES[stage], replace(config, tf=tf) if tf else config, Checksums())


@pytest.mark.parametrize(
    ("stage", "words", "tf", "expected"),
    [
        ("volume", (), None, "sphere volume"),
        ("texture", ("fit.seed=3",), "TF01", "sphere TF01 demo-s3 texture"),
        ("texture", ("fit.low_pass=2,6",), "TF01", "sphere TF01 demo-6 texture"),
        ("edit_text", (*GOLD, "edit.seed=0,1"), None, "sphere demo-128-e1 gold edit_text"),
        ("views", ("views.train.frequency=1,2",), "TF01", "sphere TF01 views views.train.frequency=2"),
    ],
)
def test_names_tell_variant_seed_and_edit(stage, words, tf, expected):
    assert name(job(stage, words, tf)) == expected


def test_tags_are_of_what_a_job_is_and_leave_out_what_it_is_not():
    result = tags(job("edit_text", (*GOLD, "edit.seed=0,1")), IDENTITY, "abc")
    expected = {"stage": "edit_text", "dataset": "sphere", "recipe": "demo", "field": "surfels"}
    expected |= {"variant": "128", "sweep": "text_size", "seed": "1", "fit_seed": "0", "edit": "gold"}
    assert result.items() >= {**expected, "device": "cpu", PARENT: "abc"}.items()
    assert not tags(job("volume", ()), IDENTITY, None).keys() & {"tf", "variant", "sweep", "edit", PARENT}


def test_nested_parameters_become_dotted_names_and_text():
    params = {
        "fit": {"steps": 30000, "rate": {"means": 1.6e-4}, "windows": [1, 2.5, None]},
        **{"shaded": True, "mask": None, "edits": {}, "volume": Path("a.vti"), "prompt": 'a "blue" one'},
    }
    assert flatten(params) == {
        "fit.steps": "30000",
        "fit.rate.means": "0.00016",
        "fit.windows": "[1, 2.5, null]",
        **{"shaded": "true", "mask": "null", "edits": "{}", "volume": "a.vti", "prompt": 'a "blue" one'},
    }


def test_losses_are_a_curve_over_iterations_and_times_one_over_frames():
    fit = FitResult(1.0, 10, iterations=30, losses=[0.3, 0.2, 0.1])
    assert not list(curves(as_mapping(fit))), "told while it ran"
    edit = EditResult("glass", "image", "patches", 1.0, iterations=4, losses={"TF01/NNFM": [0.5, 0.25]})
    assert list(curves(as_mapping(edit))) == [(2, {"loss/TF01/NNFM": 0.5}), (4, {"loss/TF01/NNFM": 0.25})]
    assert list(curves({"frames_ms": [4, 5]})) == [(0, {"frames_ms": 4.0}), (1, {"frames_ms": 5.0})]


def test_edits_by_numbers_and_pictures_of_a_gallery_have_a_metric_each_and_their_mean():
    compared = [ViewComparison("as fitted", 30.0, 0.9), ViewComparison("other colours", 20.0, 0.8)]
    metrics = scalars(as_mapping(PseResult(2, compared, [ViewComparison("light")])))
    assert metrics == {
        "views": 2.0,
        "pse_psnr": 25.0,
        "pse_psnr/as fitted": 30.0,
        "pse_psnr/other colours": 20.0,
        "pse_ssim": pytest.approx(0.85),
        "pse_ssim/as fitted": 0.9,
        "pse_ssim/other colours": 0.8,
    }
    shown = [Shown("polar", "error", "0°", psnr=30.0), Shown("polar", "error", "30°", psnr=20.0)]
    result = GalleryResult("relight", [Shown("polar", "as fitted", "0°"), *shown])
    assert scalars(as_mapping(result)) == {
        "shown_psnr/polar/error/0°": 30.0,
        "shown_psnr/polar/error/30°": 20.0,
        "shown_psnr": 25.0,
    }


def test_the_workflow_says_which_run_a_job_is_inside_of(tmp_path, monkeypatch):
    output = tmp_path / "a"
    assert of_workflow(output) == (Tracking(None, "texgs"), {}, "")
    monkeypatch.setenv("TEXGS_TRACKING", "sqlite:///x.db")
    monkeypatch.setenv(RUNS, str(tmp_path / "runs.json"))
    assert of_workflow(output) == (Tracking("sqlite:///x.db", "texgs"), {}, "")
    told = {output.as_posix(): {"parent": "abc", "swept": {"fit.seed": "1"}, "command": "texgs views"}}
    (tmp_path / "runs.json").write_text(json.dumps(told))
    expected = Tracking("sqlite:///x.db", "texgs", "abc"), {"fit.seed": "1"}, "texgs views"
    assert of_workflow(output) == expected


class Cuda:
    """A CUDA that a job has used, or has not."""

    def __init__(self, is_used):
        self.is_initialized = lambda: is_used
        if is_used:
            self.get_device_name = lambda: "H200"  # elsewhere torch has no name to tell


@pytest.mark.parametrize(
    ("settings", "is_used", "expected"),
    [
        ({"fit": {"device": "cuda"}}, True, "H200"),
        ({"fit": {"device": "cuda"}}, False, "CPU"),
        ({"fit": {"device": "cpu"}, "views": {"renderer": "gpu"}}, True, "CPU"),
        ({"views": {"renderer": "gpu"}}, True, "H200"),
        ({"views": {"renderer": "vtk"}}, False, "VTK"),
        ({}, False, "CPU"),
    ],
)
def test_the_device_is_what_showed_the_scene(monkeypatch, settings, is_used, expected):
    monkeypatch.setitem(sys.modules, "torch", SimpleNamespace(cuda=Cuda(is_used)))
    assert device(settings).split()[-1] == expected


def test_the_seed_of_a_page_is_that_of_its_look():
    page = {"look_seed": 3, "fit": {"seed": 1}}
    assert seed({**page, "look": "gold"}) == 3
    assert seed({**page, "look": "none"}) == 1
