"""The benchmark runs on a tiny scene, and its JSON holds every section or says why not."""

import json
import math
import subprocess
import sys
from pathlib import Path

import nibabel
import numpy as np
import pytest
import torch

from benchmarks import light, light_speed, slices
from benchmarks.command import call
from benchmarks.report import Measurement, Section
from benchmarks.settings import SECTIONS
from benchmarks.speeds import Sample, factor, scaled
from benchmarks.timing import Case, measure
from tests.viewer.drawn_scenes import scene_of_volume, waves
from tests.volume.scenes import SHELLS, ball
from texgs.scene.scene_file import write_scene
from texgs.volume.framing import frame_of
from texgs.volume.nrrd_file import open_grid
from texgs.volume.prepare import prepare
from texgs.volume.render import Appearance
from texgs.volume.sources import open_source
from texgs.workflow.forecast import Speed

ROOT = Path(__file__).parents[1]
TINY = ("--quick", "--sizes", "64", "--surfels", "500", "--scenes", "opaque", "--threads", "1")


@pytest.fixture(scope="module")
def everything(tmp_path_factory):
    """What a run of all sections prints and writes."""
    file = tmp_path_factory.mktemp("bench") / "new" / "results.json"
    command = [sys.executable, "-m", "benchmarks", *TINY, "--json", file]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    report = json.loads(file.read_text())
    told = ("date", "processor", "processors", "instruction_set", "torch", "texgs", "revision", "threads")
    assert all(report["machine"][name] for name in told)
    return done.stdout, report


@pytest.mark.packaging
@pytest.mark.parametrize("name", SECTIONS)
def test_section(everything, name):
    printed, report = everything
    section = report["sections"][name]
    assert section["measurements"]
    assert name in printed
    assert "average_before" in section["load"]
    for measurement in section["measurements"]:
        assert measurement.keys() == {"name", "parameters", "unit", "median", "min", "n"}
        assert measurement["unit"] in ("ms", "MB", "ratio", "1")
        assert all(math.isfinite(measurement[value]) for value in ("median", "min"))
        assert measurement["n"] >= 1
        assert measurement["parameters"]
        assert measurement["name"] != "mean difference of images" or measurement["median"] < 1e-5
    assert all(skipped["name"] and skipped["reason"] for skipped in section["skipped"])


def test_cases_take_turns_and_phases_add_up():
    order = []
    cases = [Case(name, {"case": name}, {name: lambda name=name: order.append(name)}) for name in "ab"]
    measurements = measure(cases, rounds=2, device=torch.device("cpu"), title="turns")
    assert "".join(order) == 2 * (5 * "a" + 5 * "b")
    assert [(m.name, m.n) for m in measurements] == [("a", 6), ("b", 6)]
    phases = {"first": lambda: None, "second": lambda: None}
    total, first, second = measure([Case("total", {}, phases)], 1, torch.device("cpu"), "sum")
    assert total.min >= first.min + second.min - 1e-9


def test_ratios():
    a, b = (Measurement.of("time", {"by": by}, "ms", values) for by, values in (("a", [8, 6]), ("b", [2, 1])))
    section = Section([a, b])
    section.add_ratios("by", "b", ["time"])
    ratio = section.find("time / b", by="a")
    assert (ratio.unit, ratio.median, ratio.min) == ("ratio", pytest.approx(7 / 1.5), 6)
    assert section.find("time", by="b") is b


def test_speeds_are_scaled_to_what_jobs_took():
    """By one factor, so that all jobs together take as long as they did, and work counts as it did."""
    speed, truth = Speed(3.0, 10.0, 0.05, "steps"), Speed(1.5, 5.0, 0.025, "steps")
    work = [({"steps": 100}, 0.04), ({"steps": 2000}, 0.16)]
    some = [Sample(*each, truth.seconds(*each)) for each in work]
    told = scaled(speed, factor(speed, some))
    assert [told.seconds(*each) for each in work] == pytest.approx([each.seconds for each in some])
    late = [some[0], some[1]._replace(seconds=2 * some[1].seconds)]
    told = scaled(speed, factor(speed, late))
    assert sum(told.seconds(*each) for each in work) == pytest.approx(sum(each.seconds for each in late))


def test_words_of_a_command_line_are_the_arguments(monkeypatch, capsys):
    """Of a benchmark with two words and any number of others; what does not fit is answered with the help."""
    calls = []

    def main(output: str, name: str, *overrides: str) -> None:
        calls.append((output, name, *overrides))

    def called(*words):
        monkeypatch.setattr(sys, "argv", ["benchmark", *words])
        call(main)

    called("a.json", "engine", "fit=quick")
    called("a.json", "--help")
    assert calls == [("a.json", "engine", "fit=quick")]
    assert __doc__ in capsys.readouterr().out
    with pytest.raises(SystemExit, match="2"):
        called("a.json")
    assert "missing a required argument: 'name'" in capsys.readouterr().err


def test_accuracy_of_light_is_that_of_shadows_and_grows_with_directions(monkeypatch):
    for name, value in {"CELLS": (48, 24), "DIRECTIONS": (4, 32), "MOST": 256, "REACHES": (0.2,)}.items():
        monkeypatch.setattr(light, name, value)
    grid = ball(16)
    table = light.measured(light.Looked(grid, [SHELLS], Appearance(), frame_of(grid, [SHELLS])), 12)
    assert (
        list(table.measure) == ["cells", "no shadows"] * 2 + ["no occlusion"] + ["directions, reach 0.2"] * 2
    )
    found, unhidden = (table[table.measure == name].PSNR.to_numpy() for name in ("cells", "no shadows"))
    assert (found > unhidden).all()
    few, many = table[table.choice.isin((4, 32))]["mean error"]
    assert few > many > 0


def test_speed_of_light_is_told_for_each_step_and_frame(tmp_path):
    section = light_speed.measured(scene_of_volume(tmp_path, waves()), 16, 1)
    assert {m.name for m in section.measurements if m.unit == "ms"} == {
        *(
            "extinction",
            "grid of a light",
            "changed opacity, all of it",
            "new light, grid and surfels",
            "frame under a new light",
            "openness",
            "volume",
            "scene",
        )
    }
    assert {m.name for m in section.measurements if m.unit == "ratio"} == {"volume / plain", "scene / plain"}
    assert all(m.min > 0 for m in section.measurements)


def test_slices_are_timed_and_compared_and_clicks_measured(tmp_path, monkeypatch):
    values = np.random.default_rng(0).integers(0, 255, (7, 8, 9)).astype(np.uint8)
    nibabel.save(nibabel.Nifti1Image(values, np.diag([-1, 2, 3, 1])), tmp_path / "v.nii.gz")
    prepare(open_source(tmp_path / "v.nii.gz"), tmp_path / "volume.nrrd", up="+z")
    section = slices.drawn(open_grid(tmp_path / "volume.nrrd"), tmp_path / "v.nii.gz", 1)
    assert [m.min for m in section.measurements if m.name == "equal samples"] == [1.0] * 3
    assert sum(m.unit == "ms" for m in section.measurements) >= 3
    for name, value in {"VIEWS": 1, "VIEW_SIZE": 24, "OPAQUE": 0.5, "APART": 3}.items():
        monkeypatch.setattr(slices, name, value)
    scene = write_scene(tmp_path / "scene.yaml", scene_of_volume(tmp_path, waves()))
    found = {(m.name, m.parameters["place"]): m.median for m in slices.clicked(scene, "waves")}
    assert found["share within a voxel", "clicks"] == 1
    assert found["voxels apart", "mean depth of models"] > 0
