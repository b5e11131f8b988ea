import json

import pytest

from tests.report.written import metrics
from texgs.core.errors import ArgumentError
from texgs.report.left_out import LeftOut, note, others, read_left_out
from texgs.report.metrics_files import read, read_known
from texgs.report.results import SceneResult

WOOD = {"what": "data set wood", "why": "its file is not there.", "places": ["views", "phase"]}


def test_what_is_left_out_stands_below_tables_that_would_read_it(tmp_path):
    path = tmp_path / "missing.json"
    assert read_left_out(path) == read_left_out(None) == [], "without a file nothing is missing"
    path.write_text(json.dumps([WOOD, {"what": "edit dge", "why": "no weights", "places": ["edit"]}]))
    entries = read_left_out(path)
    assert note(entries, ("phase",)) == "Left out: data set wood: its file is not there."
    assert note(entries, ("edit", "views")) == (
        "Left out: data set wood: its file is not there. edit dge: no weights."
    )
    assert note(entries, ("timing",)) == ""


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({}, "expected a list of what was left out, got dict"),
        ([1], "expected entries with what, why and places, got others"),
        ([{"what": "a"}], "expected entries with what, why and places, got others"),
        ([{**WOOD, "more": 1}], "expected entries with what, why and places, got others"),
    ],
)
def test_a_file_of_something_else_is_one_sentence(tmp_path, content, message):
    path = tmp_path / "missing.json"
    path.write_text(json.dumps(content))
    with pytest.raises(ArgumentError, match=rf"missing\.json: {message}"):
        read_left_out(path)


def test_files_of_other_versions_are_left_out_as_long_as_one_is_good(tmp_path):
    old = tmp_path / "old.json"
    old.write_text(json.dumps({"stage": "texture", "dataset": "engine", "numbers": {"surfels": 9}}))
    with pytest.raises(ArgumentError, match=r"old\.json: expected the metrics of this version"):
        read_known([old])
    good = metrics(tmp_path, "compose", SceneResult(1, 9))
    with pytest.raises(ArgumentError, match=r"old\.json: expected the metrics of this version"):
        read([old, good])
    records, left = read_known([old, good])
    assert [record.path for record in records] == [good]
    assert left == [old]
    (entry,) = others(left)
    assert str(entry) == (
        f"1 metrics file: of another version of texgs, {old} first; run its job again to have it back."
    )
    assert others([]) == []
    (tmp_path / "list.json").write_text("[]")
    with pytest.raises(ArgumentError, match="expected the metrics of a job"):
        read_known([tmp_path / "list.json", good])


def test_an_entry_ends_with_one_full_stop():
    assert str(LeftOut("a", "b", [])) == str(LeftOut("a", "b.", [])) == "a: b."


def test_what_is_left_out_is_named_once():
    assert str(LeftOut("data set wood", "data set wood: no file", [])) == "data set wood: no file."
