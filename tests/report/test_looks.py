import json
from dataclasses import replace

from texgs.report.looks import looks
from texgs.report.metrics_files import read
from texgs.report.results import EditMeasures, EditResult, SceneResult, plain


def metrics(folder, stage, result):
    path = folder / f"{len(list(folder.iterdir())):03}.json"
    record = {"stage": stage, "dataset": "engine", "recipe": "quick", "variant": "", "seed": 0}
    told = {"result": type(result).__name__, "numbers": plain(result)}
    path.write_text(json.dumps({**record, **told}))
    return path


MEASURES = EditMeasures("gold", "text", 4.0, 5.0, primitives=9, megabytes=1.0, geometry_kept=True)


def rows(table):
    return [dict(zip([c.title for c in table.columns], row.cells, strict=True)) for row in table.rows]


def test_an_edit_and_its_measures_make_a_row_above_the_papers(tmp_path):
    paths = [metrics(tmp_path, "edit_image", EditResult("glass", "image", "patches", 90.0, follows="style"))]
    measured = replace(MEASURES, edit="glass", method="image", similarity=0.3, clip="B/32")
    paths.append(metrics(tmp_path, "edit_metrics", measured))
    table = looks(read(paths))
    first, *theirs = rows(table)
    assert (first["minutes"], first["mean ms"], first["CLIP similarity"]) == (1.5, 4.0, 0.3)
    assert first["geometry kept"] == "bit for bit"
    assert table.rows[0].sources == paths
    assert "CLIP: B/32." in table.caption
    by_method = {row["method"]: row for row in theirs}
    assert len(theirs) == 4, "the paper's text-driven methods are beside those that follow words"
    assert by_method["TexGS-VolVis"]["minutes"] == 8.0
    assert by_method["ARF"]["primitives"] is None


def test_a_method_has_a_mean_row_over_its_data_sets(tmp_path):
    words = {"TF01": "turn it into gold", "TF02": "a mosaic"}
    paths = []
    for dataset, ms in (("engine", 4.0), ("jets", 8.0)):
        edit = EditResult("gold", "text", "filters", 60.0, follows="instruction", followed=words)
        for stage, result in (("edit_text", edit), ("edit_metrics", replace(MEASURES, frame_mean_ms=ms))):
            path = metrics(tmp_path, stage, result)
            path.write_text(path.read_text().replace('"engine"', f'"{dataset}"'))
            paths.append(path)
    one, two, mean, *theirs = rows(looks(read(paths)))
    assert one["follows"] == two["follows"] == "TF01: turn it into gold, TF02: a mosaic"
    assert (mean["data set"], mean["mean ms"], mean["minutes"]) == ("mean of 2", 6.0, 1.0)
    assert (mean["geometry kept"], mean["NNFM"]) == ("bit for bit", None)
    assert {row["method"]: row for row in theirs}["TexGS-VolVis"]["CLIP direction"] == 0.174


def test_what_was_not_measured_says_so_and_why(tmp_path):
    missing = replace(MEASURES, clip_missing="the weights of x are not on this machine")
    paths = [
        metrics(tmp_path, "edit_segment", EditResult("pick", "segment", "grabcut", 6.0)),
        metrics(tmp_path, "edit_text", EditResult("gold", "text", "filters", 6.0, follows="instruction")),
        metrics(tmp_path, "edit_metrics", missing),
    ]
    table = looks(read(paths))
    text = table.markdown()
    assert "CLIP not measured: the weights of x are not on this machine." in text
    line = next(line for line in text.splitlines() if "| gold |" in line)
    assert line.count("not measured") == 8, "CLIP, style and consistency"
    assert rows(table)[-1]["geometry kept"] is None, "the segment was not measured"


def test_without_edits_there_are_no_rows(tmp_path):
    assert looks(read([metrics(tmp_path, "compose", SceneResult(1, 9))])).rows == []
