import pytest

from tests.report.written import lines, metrics, records, rows, sources
from texgs.report.edit_tables import image_driven, looks, text_driven, text_driven_frozen
from texgs.report.results import EditMeasures, EditResult

OWN = {  # columns by the headings of the paper's files
    "editing_min": "minutes",
    "model_mb": "MB",
    "render_mean_ms": "mean ms",
    "render_max_ms": "max ms",
    "primitives": "primitives",
    "clip_similarity": "CLIP similarity",
    "clip_directional_similarity": "CLIP direction",
}
TABLES = [  # table, file of the paper, what edits follow
    (image_driven, "image_npse", "style"),
    (text_driven, "text_npse", "instruction"),
]
OF_PAPER = ("five_jets", "mantle", "supernova", "engine")
VALUES = {"frame_mean_ms": 4.0, "frame_max_ms": 5.0, "primitives": 9, "megabytes": 1.0, "geometry_kept": True}


def edit(folder, name, values, *, follows, method="text", how="how", pixels=512, **facts):
    """Metrics of an edit and of its measures, by the headings of the paper's files; returns their paths."""
    kept, is_compared = facts.pop("kept", True), facts.pop("compared", True)
    told = {"follows": follows, "is_compared": is_compared}
    result = EditResult(name, method, how, 60 * values.get("editing_min", 1.0), **told)
    measured = {
        "frame_mean_ms": values.get("render_mean_ms", 4.0),
        "frame_max_ms": values.get("render_max_ms", 5.0),
        "primitives": round(values.get("primitives") or 9),
        "megabytes": values.get("model_mb", 1.0),
        "geometry_kept": kept,
        "similarity": values.get("clip_similarity"),
        "direction": values.get("clip_directional_similarity"),
        "clip": "B/32",
    }
    measures = EditMeasures(name, method, pixels, pixels, measured)
    paths = [metrics(folder, f"edit_{method}", result, **facts)]
    return [*paths, metrics(folder, "edit_metrics", measures, **facts)]


@pytest.mark.parametrize(("make", "name", "follows"), TABLES)
def test_means_over_four_data_sets_are_the_papers_rows(tmp_path, make, name, follows):
    """Values around the paper's means give these; a stand-in far from them changes nothing."""
    published = lines(name)
    for line in published:
        numbers = {key: value for key, value in line.items() if isinstance(value, float)}
        for dataset, factor in zip(OF_PAPER, (0.6, 0.8, 1.2, 1.4), strict=True):
            values = {key: value * factor for key, value in numbers.items()}
            edit(tmp_path, line["method"], values, follows=follows, dataset=dataset)
        far = {key: 100 * value for key, value in numbers.items()}
        edit(tmp_path, line["method"], far, follows=follows, dataset="e", stand_in=OF_PAPER[0])
    entries = rows(make(records(tmp_path)))
    theirs = {row["method"]: row for row in entries if row["recipe"] == "the paper"}
    ours = [row for row in entries if row["recipe"] == "quick"]
    means = {row["edit"]: row for row in ours if row["data set"] == "mean of 4"}
    assert len(entries) == len(published) * 7
    for line in published:
        for key, title in OWN.items():
            if isinstance(line.get(key), float):
                assert means[line["method"]][title] == pytest.approx(line[key], rel=2e-5)
                assert theirs[line["method"]][title] == line[key]
            elif key in line:
                assert theirs[line["method"]][title] == "-", "the paper counts no voxels"
        assert means[line["method"]]["geometry kept"] == "bit for bit"


@pytest.mark.parametrize(("make", "name", "follows"), TABLES)
def test_columns_are_in_the_papers_order(tmp_path, make, name, follows):
    edit(tmp_path, "mine", {}, follows=follows)
    table = make(records(tmp_path))
    titles = [column.title for column in table.columns]
    assert titles[:5] == ["data set", "recipe", "edit", "method", "pixels"]
    theirs = [OWN[heading] for heading in lines(name)[0] if heading in OWN]
    assert titles[5 : 5 + len(theirs)] == theirs
    assert "RMSE, near" in titles


def test_means_are_of_one_size_device_and_recipe_whatever_it_has_adapted_to(tmp_path):
    for dataset, pixels, how, minutes, device in (
        ("a", 512, "VGG-16 + patches", 1.0, "CPU"),
        ("b", 512, "VGG-16", 3.0, "CPU"),
        ("c", 512, "VGG-16", 9.0, "GPU"),
        ("d", 800, "VGG-16", 50.0, "CPU"),
        ("e", 800, "VGG-16", 70.0, "CPU"),
    ):
        options = {"follows": "style", "method": "image", "how": how, "pixels": pixels, "device": device}
        edit(tmp_path, "style", {"editing_min": minutes}, dataset=dataset, **options)
    late = EditResult("style", "image", "VGG-16", 6000.0, follows="style", is_compared=True)
    metrics(tmp_path, "edit_image", late, dataset="f")
    entries = rows(image_driven(records(tmp_path)))
    means = [row for row in entries if row["data set"].startswith("mean") and row["recipe"] == "quick"]
    assert [(row["data set"], row["pixels"], row["method"], row["minutes"]) for row in means] == [
        ("mean of 2", "512x512", "adapts", 2.0),
        ("mean of 2", "800x800", "image: VGG-16", 60.0),
    ], "of an edit that was not measured no size is known"


def test_each_kind_of_edit_has_its_own_table(tmp_path):
    edit(tmp_path, "style", {}, follows="style", method="image")
    edit(tmp_path, "painted", {}, follows="style", method="image", compared=False)
    edit(tmp_path, "text", {}, follows="instruction")
    edit(tmp_path, "gold", {}, follows="instruction", compared=False)
    edit(tmp_path, "lambda", {}, follows="style", method="image", sweep="lambda_s", variant="0")
    metrics(tmp_path, "edit_segment", EditResult("pick", "segment", "grabcut", 6.0))
    of_images, of_texts, of_all = (
        [row for row in rows(make(records(tmp_path))) if row["recipe"] != "the paper"]
        for make in (image_driven, text_driven, looks)
    )
    assert [row["edit"] for row in of_images] == ["style"]
    assert [row["edit"] for row in of_texts] == ["text"]
    assert [row["edit"] for row in of_all] == ["style", "painted", "text", "gold", "pick"]
    assert "CLIP similarity" not in of_images[0], "the paper measures it of texts"
    assert text_driven_frozen(records(tmp_path)).is_empty


def test_other_methods_with_frozen_geometry_are_compared_by_themselves(tmp_path):
    options = {"follows": "instruction", "field": "gaussians", "method": "dge"}
    edit(tmp_path, "dge", {}, **options, kept=False)
    edit(tmp_path, "dge_frozen", {}, **options, kept=True)
    edit(tmp_path, "text", {}, follows="instruction")
    edit(tmp_path, "arf", {}, follows="style", field="voxels", method="arf", kept=True)
    free, frozen = (rows(make(records(tmp_path))) for make in (text_driven, text_driven_frozen))
    assert [row["edit"] for row in free if row["recipe"] != "the paper"] == ["dge", "text"]
    assert [row["edit"] for row in frozen] == ["dge_frozen", "text"]
    assert rows(image_driven(records(tmp_path)))[0]["edit"] == "arf"


def test_a_row_leads_to_the_edit_and_its_measures(tmp_path):
    paths = edit(tmp_path, "gold", {"clip_similarity": 0.3}, follows="instruction")
    late = EditResult("late", "text", "how", 6.0, follows="instruction", is_compared=True)
    metrics(tmp_path, "edit_text", late)
    table = text_driven(records(tmp_path))
    gold, late = rows(table)[:2]
    assert sources(table)[0] == paths
    assert (gold["pixels"], gold["CLIP similarity"]) == ("512x512", 0.3)
    assert (late["pixels"], late["mean ms"], late["minutes"]) == (None, None, 0.1)
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
    assert line.count("not measured") == 14, "CLIP, style, consistency, places and readability"
    assert rows(table)[-1]["geometry kept"] is None, "the segment was not measured"


def test_looks_of_one_scene_tell_the_place_of_their_picture_among_all(tmp_path):
    """Less the mean over both looks each is nearest to its own; a scene with one look has no place."""
    for dataset, name, far in (
        ("a", "glass", (1.0, 4.0, 0.5)),
        ("a", "dots", (3.0, 3.0, 0.5)),
        ("b", "glass", (1.0, 1.0, 1.0)),
    ):
        followed = {"TF01": name}
        metrics(
            tmp_path,
            "edit_image",
            EditResult(name, "image", "x", 6.0, follows="style", followed=followed),
            dataset=dataset,
        )
        both = {
            f"far_by_{kind}": dict(zip(("glass", "dots", "hub"), far, strict=True))
            for kind in ("colors", "pattern")
        }
        metrics(tmp_path, "edit_metrics", EditMeasures(name, "image", 9, 9, VALUES | both), dataset=dataset)
    places = {(row["data set"], row["edit"]): row["place, colours"] for row in rows(looks(records(tmp_path)))}
    assert places == {("a", "glass"): 1, ("a", "dots"): 1, ("b", "glass"): None}


@pytest.mark.parametrize(("make", "name", "follows"), TABLES)
def test_own_data_have_no_rows_of_the_paper(tmp_path, make, name, follows):
    edit(tmp_path, lines(name)[0]["method"], {}, follows=follows, dataset="mine")
    assert [row["recipe"] for row in rows(make(records(tmp_path)))] == ["quick"]
