import json

from texgs.report.looks import COLUMNS, looks


def metrics(folder, stage, numbers):
    path = folder / f"{len(list(folder.iterdir())):03}.json"
    record = {"stage": stage, "dataset": "engine", "recipe": "quick", "variant": "", "seed": 0}
    path.write_text(json.dumps({**record, "numbers": numbers}))
    return path


def rows(table):
    return [dict(zip([c.title for c in table.columns], row.cells, strict=True)) for row in table.rows]


def test_an_edit_and_its_measures_make_a_row_above_the_papers(tmp_path):
    edit = {"edit": "glass", "method": "image", "how": "patches", "lambda_s": None, "edit_seconds": 90.0}
    paths = [metrics(tmp_path, "edit_image", edit)]
    measured = {
        "edit": "glass",
        "frame_mean_ms": 4.0,
        "geometry_kept": True,
        "similarity": 0.3,
        "clip": "B/32",
    }
    paths.append(metrics(tmp_path, "edit_metrics", measured))
    table = looks(paths)
    first, *theirs = rows(table)
    assert (first["minutes"], first["mean ms"], first["CLIP similarity"]) == (1.5, 4.0, 0.3)
    assert first["geometry kept"] == "bit for bit"
    assert table.rows[0].sources == paths
    assert "CLIP: B/32." in table.caption
    by_method = {(row["edit"][:5], row["method"]): row for row in theirs}
    assert len(theirs) == 8
    assert by_method["image", "TexGS-VolVis"]["minutes"] == 8.0
    assert by_method["text-", "TexGS-VolVis"]["CLIP direction"] == 0.174
    assert by_method["image", "ARF"]["primitives"] is None


def test_what_was_not_measured_says_so_and_why(tmp_path):
    edit = {"edit": "pick", "method": "segment", "how": "grabcut", "lambda_s": None, "edit_seconds": 6.0}
    other = {"edit": "gold", "method": "text", "how": "filters", "lambda_s": None, "edit_seconds": 6.0}
    missing = {"edit": "gold", "clip_missing": "the weights of x are not on this machine"}
    paths = [
        metrics(tmp_path, stage, numbers)
        for stage, numbers in (("edit_segment", edit), ("edit_text", other), ("edit_metrics", missing))
    ]
    table = looks(paths)
    text = table.markdown()
    assert "CLIP not measured: the weights of x are not on this machine." in text
    line = next(line for line in text.splitlines() if "| gold |" in line)
    assert line.count("not measured") >= len(COLUMNS) - 8
    assert rows(table)[0]["geometry kept"] is None


def test_without_edits_there_are_no_rows(tmp_path):
    assert looks([metrics(tmp_path, "timing", {})]).rows == []
