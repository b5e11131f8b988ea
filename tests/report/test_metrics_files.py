"""Metrics files: which are read, what is refused, and what there is no job of."""

import json

import pytest

from tests.refusals import refused
from tests.report.written import metrics
from texgs.report.metrics_files import LeftOut, below, note, read_known, read_left_out
from texgs.report.results import FitResult, SceneResult

WOOD = {"what": "data set wood", "why": "its file is not there.", "places": ["views", "phase"]}


def test_what_is_left_out_stands_below_tables_that_would_read_it(tmp_path):
    path = tmp_path / "missing.json"
    assert read_left_out(path) == read_left_out(None) == [], "without a file nothing is missing"
    path.write_text(json.dumps([WOOD, {"what": "edit dge", "why": "no weights", "places": ["edit"]}]))
    entries = read_left_out(path)
    wood = "Left out: data set wood: its file is not there."
    assert note(entries, ("phase",)) == wood
    assert note(entries, ("edit", "views")) == f"{wood} edit dge: no weights."
    assert note(entries, ("timing",)) == ""


@pytest.mark.parametrize("content", [{}, [1], [{"what": "a"}], [{**WOOD, "more": 1}]])
def test_a_file_of_something_else_is_named(tmp_path, content):
    path = tmp_path / "missing.json"
    path.write_text(json.dumps(content))
    refused(lambda: read_left_out(path), r"missing\.json: expected")


def test_files_of_other_versions_are_left_out_as_long_as_one_is_good(tmp_path):
    old = tmp_path / "old.json"
    old.write_text(json.dumps({"stage": "texture", "dataset": "engine", "numbers": {"surfels": 9}}))
    refused(lambda: read_known([old]), r"old\.json: expected the metrics of this version")
    good = metrics(tmp_path, "compose", SceneResult(1, 9))
    records, (entry,) = read_known([old, good])
    assert [record.path for record in records] == [good]
    why = f"of another version of texgs, {old} first; run its job again to have it back."
    assert str(entry) == f"1 metrics file: {why}"
    assert read_known([good]) == (records, [])
    (tmp_path / "list.json").write_text("[]")
    refused(lambda: read_known([tmp_path / "list.json", good]), "expected the metrics of a job")


@pytest.mark.parametrize("why", ["no file", "no file.", "data set wood: no file"])
def test_an_entry_names_once_what_is_left_out_and_ends_with_one_full_stop(why):
    assert str(LeftOut("data set wood", why, [])) == "data set wood: no file."


def test_copies_of_tracked_runs_and_jobs_at_work_are_no_results(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for folder in ("fuel/volume", "fuel/.views.work", "mlartifacts/0f3c/artifacts"):
        path = tmp_path / "results" / folder / "metrics.json"
        path.parent.mkdir(parents=True)
        path.write_text("{}")
    monkeypatch.chdir(tmp_path / "results" / "fuel" / ".views.work")
    found = below("../../../results"), below(tmp_path / "results")
    assert list(map(len, found)) == [1, 1], "the folder's own name is free"
    monkeypatch.chdir(tmp_path)
    assert [path.as_posix() for path in below("results")] == ["results/fuel/volume/metrics.json"]


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"seed": "x"}, "seed"),
        ({"dataset": 3}, "dataset"),
        ({"variant": None}, "variant"),
        ({"peak_memory_mib": "much"}, "peak_memory_mib"),
        ({"numbers": [1]}, "numbers"),
        ({"pictures": ["a.png"]}, "pictures"),
        ({"numbers": {"fit_seconds": 1.0, "primitives": "many"}}, "numbers.primitives"),
        ({"numbers": {"fit_seconds": 1.0, "primitives": 9, "sizes": 3}}, "numbers.sizes"),
        ({"result": "EditMeasures", "numbers": {"edit": "a", "method": "b", "clip": 1}}, "numbers.clip"),
    ],
)
def test_a_value_of_another_type_is_an_error_with_file_and_key(tmp_path, change, key):
    path = metrics(tmp_path, "shading", FitResult(60.0, 9), "scan", "TF01")
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    refused(lambda: read_known([path]), rf"{path.name}: {key}: ")
