"""The benchmark runs on a tiny scene, and its JSON holds every section or says why not."""

import json
import math
import subprocess
import sys
from pathlib import Path

import pytest
import torch

from benchmarks.command import call
from benchmarks.report import Measurement, Section
from benchmarks.settings import SECTIONS, parse
from benchmarks.speeds import Sample, factor, scaled
from benchmarks.timing import Case, measure
from texgs.workflow.forecast import Speed

ROOT = Path(__file__).parents[1]
TINY = ("--quick", "--sizes", "64", "--surfels", "500", "--scenes", "opaque", "--threads", "1")


def run(*arguments):
    command = [sys.executable, "-m", "benchmarks", *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300, check=False)


@pytest.fixture(scope="module")
def everything(tmp_path_factory):
    """What a run of all sections prints and writes."""
    file = tmp_path_factory.mktemp("bench") / "new" / "results.json"
    done = run(*TINY, "--json", str(file))
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
    assert all(skipped["name"] and skipped["reason"] for skipped in section["skipped"])


@pytest.mark.packaging
def test_passes_and_peers(everything):
    sections = everything[1]["sections"]
    names = {m["name"] for m in sections["rasterize"]["measurements"]}
    passes = {f"pass {name}" for name in ("project", "sort", "bin", "forward", "backward", "reduce")}
    assert names == {"forward", "step", "step forward", "step backward", "step Adam"} | passes
    both = (sections["peers"], sections["instruction_sets"])
    measured, skipped = ([each for part in both for each in part[key]] for key in ("measurements", "skipped"))
    peers = [m["parameters"]["peer"] for m in measured] + [each["name"] for each in skipped]
    for peer in ("gsplat's torch functions", "avx512", "avx2", "portable"):
        assert any(peer in name for name in peers), peer
    assert all(m["median"] < 1e-5 for m in measured if m["name"] == "mean difference of images")


@pytest.mark.packaging
def test_sections_can_be_left_out(tmp_path):
    file = tmp_path / "results.json"
    assert run(*TINY, "--sections", "rasterize", "--json", str(file)).returncode == 0
    sections = json.loads(file.read_text())["sections"]
    assert sections["rasterize"]["measurements"]
    skipped = [{"name": "losses", "reason": "not in --sections"}]
    assert sections["losses"] == {"measurements": [], "skipped": skipped}


@pytest.mark.packaging
def test_a_missing_gpu_is_reported():
    if torch.cuda.is_available():
        pytest.skip("this machine has a GPU")
    done = run(*TINY, "--device", "cuda")
    assert done.returncode == 1
    assert done.stderr == "--device cuda: torch sees no GPU; leave it out to measure the CPU\n"


def test_defaults_are_those_of_the_targets():
    settings = parse([])
    assert (settings.sizes, settings.surfels) == ((400, 800), (15_000, 60_000, 240_000))
    assert (settings.scene, settings.size, settings.n_surfels) == ("opaque", 800, 60_000)


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
    speed, truth = Speed(3.0, 10.0, 0.05), Speed(1.5, 5.0, 0.025)
    work = [(0.04, 100), (0.16, 2000)]
    some = [Sample(*each, truth.seconds(*each)) for each in work]
    assert vars(scaled(speed, factor(speed, some))) == pytest.approx(vars(truth))
    late = [some[0], some[1]._replace(seconds=2 * some[1].seconds)]
    told = scaled(speed, factor(speed, late))
    assert sum(told.seconds(*each) for each in work) == pytest.approx(sum(each.seconds for each in late))


def called(monkeypatch, *words):
    """What a benchmark with two words and any number of others was called with."""
    calls = []

    def main(output: str, name: str, *overrides: str) -> None:
        calls.append((output, name, *overrides))

    monkeypatch.setattr(sys, "argv", ["benchmark", *words])
    call(main)
    return calls


def test_words_of_a_command_line_are_the_arguments(monkeypatch, capsys):
    assert called(monkeypatch, "a.json", "engine", "fit=quick") == [("a.json", "engine", "fit=quick")]
    assert called(monkeypatch, "a.json", "--help") == []
    assert __doc__ in capsys.readouterr().out


def test_words_that_do_not_fit_are_answered_with_the_help(monkeypatch, capsys):
    with pytest.raises(SystemExit, match="2"):
        called(monkeypatch, "a.json")
    told = capsys.readouterr().err
    assert __doc__ in told
    assert "missing a required argument: 'name'" in told
