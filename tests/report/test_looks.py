from tests.report.written import metrics, records, rows, sources
from texgs.report.edit_tables import looks
from texgs.report.results import EditMeasures, EditResult, SceneResult

VALUES = {"frame_mean_ms": 4.0, "frame_max_ms": 5.0, "primitives": 9, "megabytes": 1.0, "geometry_kept": True}


def test_an_edit_and_its_measures_make_a_row(tmp_path):
    paths = [metrics(tmp_path, "edit_image", EditResult("glass", "image", "patches", 90.0, follows="style"))]
    values = VALUES | {"similarity": 0.3, "clip": "B/32", "style_gram": 1.5}
    measured = EditMeasures("glass", "image", values=values)
    paths.append(metrics(tmp_path, "edit_metrics", measured))
    table = looks(records(tmp_path))
    (row,) = rows(table)
    assert (row["minutes"], row["mean ms"], row["CLIP similarity"], row["Gram"]) == (1.5, 4.0, 0.3, 1.5)
    assert row["geometry kept"] == "bit for bit"
    assert sources(table)[0] == paths
    assert "CLIP of the scores: B/32;" in table.caption


def test_what_models_follow_is_told_once_where_it_is_the_same(tmp_path):
    words = {"TF01": "turn it into gold", "TF02": "a mosaic"}
    for name, followed in (("a", words), ("b", dict.fromkeys(words, "gold")), ("c", {})):
        edit = EditResult(name, "text", "filters", 60.0, follows="instruction", followed=followed)
        metrics(tmp_path, "edit_text", edit)
    assert [row["follows"] for row in rows(looks(records(tmp_path)))] == [
        "TF01: turn it into gold, TF02: a mosaic",
        "gold",
        "-",
    ]


def test_what_was_not_measured_says_so_and_why(tmp_path):
    metrics(tmp_path, "edit_segment", EditResult("pick", "segment", "grabcut", 6.0))
    metrics(tmp_path, "edit_text", EditResult("gold", "text", "filters", 6.0, follows="instruction"))
    values = VALUES | {"clip_missing": "the weights of x are not on this machine"}
    missing = EditMeasures("gold", "text", values=values)
    metrics(tmp_path, "edit_metrics", missing)
    table = looks(records(tmp_path))
    text = table.markdown()
    assert "CLIP not measured: the weights of x are not on this machine." in text
    line = next(line for line in text.splitlines() if "| gold |" in line)
    assert line.count("not measured") == 8, "CLIP, style and consistency"
    assert rows(table)[-1]["geometry kept"] is None, "the segment was not measured"


def test_without_edits_there_are_no_rows(tmp_path):
    metrics(tmp_path, "compose", SceneResult(1, 9))
    assert looks(records(tmp_path)).is_empty
