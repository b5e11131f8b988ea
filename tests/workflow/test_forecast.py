"""What a run would find and do, before it is started."""

import re

import pytest

from tests.workflow.project import TINY
from texgs.cli.main import main
from texgs.workflow import forecast
from texgs.workflow.stage_table import STAGES


@pytest.fixture(autouse=True)
def empty(tmp_path, monkeypatch):
    """A folder without data, results and weights."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("TEXGS_DATA", "nowhere")
    monkeypatch.setenv("TEXGS_WEIGHTS", str(tmp_path))


def test_each_stage_has_a_speed_and_no_other():
    assert set(forecast.speeds()) == set(STAGES)


def test_seconds_follow_pixels_and_iterations():
    speed, settings = forecast.Speed(2.0, 10.0, 0.5, "phase.iterations"), {"phase": {"iterations": 100}}
    assert speed.seconds(settings, 0.16) == pytest.approx(2 + 0.16 * 10 + 0.16 * 100 * 0.5)
    assert forecast.number({"stages": [{"steps": 3}, {"steps": 4}]}, "stages.steps") == 7
    assert forecast.number({"iterations": None}, "iterations") == 0


def test_the_jobs_of_a_run_are_counted_each_once():
    words = ("dataset=orbital", "fit=demo", "edits=[gold]")
    expected = forecast.forecast(words)
    orbital = {"volume": 1, "transfer": 1, "views": 2, "surfels": 2, "texture": 2, "edit_text": 1}
    assert {name: expected.to_do[name] for name in orbital} == orbital
    assert expected.done == 0
    assert expected.seconds > forecast.START_SECONDS + forecast.STEP_SECONDS * sum(expected.to_do.values())


@pytest.mark.parametrize("words", [("fit=quick",), ("fit=gaussians",), ("fit=plenoxels",), ("fit=stylerf",)])
def test_iterations_are_where_the_table_says(words):
    """A key that has been renamed would be a KeyError."""
    few, many = (
        forecast.forecast(("dataset=orbital", *words, f"views.width={width}")) for width in (50, 800)
    )
    assert few.seconds < many.seconds


def test_what_comes_from_results_that_will_be_replaced_is_to_do():
    """A sheet of views does not depend on their settings, but on the views."""
    words = (*TINY.split(), "tf=TF01", "tracking=none")
    assert main(["sheet", *words]) == 0
    assert forecast.forecast(words).to_do["sheet"] == 0
    assert forecast.forecast((*words, "views.width=20")).to_do["sheet"] == 1


def test_of_a_sweep_the_jobs_are_counted_that_a_run_goes_through():
    stages = forecast.forecast(("dataset=orbital", "fit=demo", "fit.texture.sweeps=1,2")).to_do
    assert stages["texture"] == 4
    assert not {"figure", "compose", "pse", "timing", "page"} & set(stages)


def test_the_doctor_tells_what_a_run_finds_and_about_how_long_it_takes(capsys, tmp_path):
    words = ["datasets=[engine,wood,orbital]", "views=small", "fit=quick", "on_missing=skip", "edits=[style]"]
    assert main(["doctor", *words]) == 0
    told = capsys.readouterr().out
    assert re.search(r"ok +data set engine +to be downloaded from https://", told)
    assert re.search(r"ok +data set orbital +generated: orbital", told)
    assert re.search(r"left out data set wood: \S*woodbranch\S* is not there", told)
    assert re.search(r"left out edit style: .*weights of vgg16 are not on this machine", told)
    assert re.search(r"jobs +\d+ to do \(.*4 views.*\), 0 done", told)
    assert re.search(r"time +about \d+ min on two cores", told)
    assert not list(tmp_path.iterdir())  # nothing is written


def test_a_sweep_and_mistakes_are_those_of_a_run(capsys):
    assert main(["doctor", "dataset=orbital", "fit=demo", "fit.seed=0,1"]) == 0
    assert " 4 texture" in capsys.readouterr().out, "two seeds of two basic TFs"
    assert main(["doctor", "dataset=orbital", "fit=plenoxels_quick", "device=cuda"]) == 2
    assert "device: expected cpu for fit=plenoxels_quick" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("seconds", "words"), [(5, "1 min"), (3700, "62 min"), (7300, "2 hours"), (180_000, "2 days")]
)
def test_times_are_told_as_one_says_them(seconds, words):
    assert forecast.duration(seconds) == words


def test_a_run_that_would_not_start_is_told(capsys):
    assert main(["doctor", "dataset=wood", "fit=quick"]) == 1
    told = capsys.readouterr().out
    assert re.search(r"missing +data set wood: .* is not there", told)
    assert "ok  " not in told
    assert main(["doctor", "--experiment", "papr"]) == 2
    assert "paper" in capsys.readouterr().err
