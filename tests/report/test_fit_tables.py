"""Tables of fits: metrics that are some multiples of the paper's have means or sums that are the paper's."""

from dataclasses import replace

import pytest

from tests.report.written import lines, metrics, records, rows, sources
from texgs.report.fit_tables import ablation, fits, fitting, model_size
from texgs.report.results import FitResult
from texgs.report.table import UNLIKE_CELL, columns
from texgs.report.tables import spec_of

DATASETS = {line["dataset"]: line for line in lines("datasets")}
ENGINE = next(line for line in lines("fitting") if line["dataset"] == "engine")
VARIANTS = {"views": "views", "resolution": "image_px"}  # columns of the paper's files, by sweep
UNKNOWN = FitResult(60.0, 9)


def seen(dataset):
    """What the paper's fits of a data set are compared with."""
    pixels = int(DATASETS[dataset]["image_px"])
    return {"train_views": 162, "width": pixels, "height": pixels}


def phase_of(line, factor=1.0):
    """A phase whose measures are some multiple of the paper's."""
    return FitResult(
        60 * line["minutes"] * factor,
        round(line["primitives"] * factor),
        psnr=line["psnr"] * factor,
        ssim=line["ssim"] * factor,
        peak_gpu_memory_mib=1024 * line["gpu_gb"] * factor,
        **seen(line["dataset"]),
    )


def parted(table):
    """Our rows, and those of the paper alone."""
    entries = rows(table)
    theirs = [row for row in entries if row["recipe"] == "the paper"]
    return [row for row in entries if row not in theirs], theirs


def check_row(row, line, columns, scenes, rel=2e-5):
    """Require of a row what a line of the paper's file has; primitives are whole numbers."""
    assert row["recipe"] == "paper"
    assert row["basic scenes"] == scenes
    for key, column in columns.items():
        assert row[column.title] == pytest.approx(line[key], rel=rel)
        assert row[f"{column.title} (paper)"] == line[key]


def test_means_of_the_papers_basic_scenes_are_the_papers_rows(tmp_path):
    """10 % above and below where a data set has two scenes."""
    for line in lines("fitting"):
        dataset, scenes = line["dataset"], DATASETS[line["dataset"]]["basic_scenes"]
        for index, factor in enumerate([1.0] if scenes == 1 else [0.9, 1.1]):
            facts = {"recipe": "paper", "peak_memory_mib": 1024 * line["cpu_gb"] * factor}
            metrics(tmp_path, line["phase"], phase_of(line, factor), dataset, f"TF{index}", **facts)
    for row, line in zip(rows(fitting(records(tmp_path))), lines("fitting"), strict=True):
        assert (row["data set"], row["phase"]) == (line["dataset"], line["phase"])
        check_row(row, line, columns("fitting"), DATASETS[line["dataset"]]["basic_scenes"])


@pytest.mark.parametrize(
    ("changed", "facts"),
    [
        ({}, {"recipe": "quick"}),
        ({"width": 400}, {}),
        ({"train_views": 92}, {}),
        ({"width": None, "height": None}, {}),
        ({}, {"variant": "hand"}),
        ({}, {"recipe_changed": True}),
    ],
)
def test_other_recipes_and_sizes_have_a_sign_and_the_paper_rows_of_its_own(tmp_path, changed, facts):
    result = replace(phase_of(ENGINE), **changed)
    metrics(tmp_path, "surfels", result, tf="TF01", **{"recipe": "paper"} | facts)
    table = fitting(records(tmp_path))
    (own,), theirs = parted(table)
    assert (own["PSNR"], own["PSNR (paper)"]) == (ENGINE["psnr"], UNLIKE_CELL)
    assert len(theirs) == 24
    assert [row["PSNR"] for row in theirs if row["data set"] == "engine"] == [30.15, 33.25, 33.29]
    assert "not like for like" in spec_of("fitting").table(records(tmp_path)).caption


def test_a_stand_in_has_a_row_of_its_own_without_the_papers_numbers(tmp_path):
    line = next(line for line in lines("fitting") if line["dataset"] == "five_jets")
    metrics(tmp_path, "surfels", phase_of(line), "jets", "TF01", recipe="paper", stand_in="five jets")
    entries = rows(fitting(records(tmp_path)))
    assert [row["data set"] for row in entries[:4]] == ["five_jets"] * 3 + ["jets, stand-in for five jets"]
    assert [row["recipe"] for row in entries[:4]] == ["the paper"] * 3 + ["paper"]
    assert {entries[3][f"{column.title} (paper)"] for column in columns("fitting").values()} == {None}


def test_a_measure_that_a_basic_scene_lacks_has_no_mean(tmp_path):
    """Of data that the paper does not have; phases that are not known here come last."""
    metrics(tmp_path, "ball", UNKNOWN, "scan", "TF01", field="ball")
    metrics(tmp_path, "shading", FitResult(60.0, 10, psnr=30.0), "scan", "TF01")
    metrics(tmp_path, "shading", FitResult(120.0, 20), "scan", "TF02")
    row, last = rows(fitting(records(tmp_path)))
    assert (row["PSNR"], row["minutes"], row["primitives"]) == (None, 1.5, 15)
    assert (row["data set"], row["PSNR (paper)"], last["phase"]) == ("scan", None, "ball")


def test_fits_are_listed_one_by_one_but_for_those_of_sweeps(tmp_path):
    for tf in ("TF02", "TF01"):
        for phase in ("texture", "shading"):
            metrics(tmp_path, phase, replace(UNKNOWN, relit_psnr=29.5), tf=tf)
    metrics(tmp_path, "texture", UNKNOWN, tf="TF01", sweep="views", variant="42")
    entries = [(row["TF"], row["phase"], row["minutes"]) for row in rows(fits(records(tmp_path)))]
    assert entries == [(tf, phase, 1.0) for tf in ("TF01", "TF02") for phase in ("shading", "texture")]
    assert {row["PSNR under unseen lights"] for row in rows(fits(records(tmp_path)))} == {29.5}
    assert all("42" not in row["recipe"] for row in rows(fitting(records(tmp_path))))


def write_fit(folder, line, sweep="views", factor=1.0, tf="TF01", name="", **facts):
    """Metrics of a fit, whose measures are some multiple of the paper's; its phases share the minutes."""
    variant = int(line[VARIANTS[sweep]])
    pixels, views = (512, variant) if sweep == "views" else (variant, 162)
    result = FitResult(
        60 * line["fitting_min"] * factor / 3,
        round(line["primitives"] * factor),
        psnr=line["test_psnr"] * factor,
        ssim=line["test_ssim"] * factor,
        train_psnr=line["train_psnr"] * factor,
        train_ssim=line["train_ssim"] * factor,
        train_views=views,
        width=pixels,
        height=pixels,
    )
    known = {"dataset": line["dataset"], "recipe": "paper", "sweep": name or sweep, "variant": str(variant)}
    for phase in ("surfels", "shading", "texture"):
        metrics(folder, phase, result, tf=tf, **known | facts)


@pytest.mark.parametrize("sweep", list(VARIANTS))
def test_means_of_the_papers_basic_scenes_and_seeds_are_the_papers_rows(tmp_path, sweep):
    for line in lines(sweep):
        for tf, factor in (("TF01", 0.9), ("TF02", 1.1)):
            for seed, more in ((0, 0.05), (1, -0.05)):
                write_fit(tmp_path, line, sweep, factor + more, tf, seed=seed)
    for row, line in zip(rows(ablation(records(tmp_path), sweep)), lines(sweep), strict=True):
        check_row(row, line, columns("views"), 2)


@pytest.mark.parametrize("changed", [{"recipe": "quick"}, {"dataset": "engine"}, {"stand_in": "ionization"}])
def test_what_is_not_like_for_like_stands_above_the_papers_rows(tmp_path, changed):
    write_fit(tmp_path, lines("views")[0], **changed)
    (own,), theirs = parted(ablation(records(tmp_path), "views"))
    assert own["PSNR (paper)"] in (UNLIKE_CELL, None)
    assert [row["training views"] for row in theirs] == ["42", "92", "162", "252"]
    assert [row["PSNR"] for row in theirs] == [29.33, 30.95, 31.64, 31.71]


def test_a_fit_with_a_missing_phase_is_not_measured(tmp_path):
    for tf in ("TF01", "TF02"):
        write_fit(tmp_path, lines("views")[0], tf=tf)
    max(tmp_path.iterdir()).unlink()
    own = rows(ablation(records(tmp_path), "views"))[0]
    assert {own[column.title] for column in columns("views").values()} == {None}
    assert own["PSNR (paper)"] == UNLIKE_CELL


def test_other_sweeps_do_not_count_but_for_their_like(tmp_path):
    for dataset, sweep in (("scan", "views"), ("other", "views_quick"), ("third", "viewshed")):
        write_fit(tmp_path, lines("views")[0], dataset=dataset, name=sweep)
    assert [row["data set"] for row in rows(ablation(records(tmp_path), "views"))] == ["other", "scan"]
    assert ablation(records(tmp_path), "resolution").is_empty


def test_sums_over_the_papers_basic_scenes_are_the_papers_sizes(tmp_path):
    for line in lines("model_size"):
        scenes = int(line["basic_scenes"])
        sizes = {group: line[group] / scenes for group in columns("model_size") if group != "primitives"}
        result = FitResult(60.0, round(line["primitives"] / scenes), sizes=sizes, **seen(line["dataset"]))
        for index in range(scenes):
            metrics(tmp_path, "texture", result, line["dataset"], f"TF{index}", "paper")
    by_dataset = {row["data set"]: row for row in rows(model_size(records(tmp_path)))}
    assert len(by_dataset) == len(model_size(records(tmp_path)).rows) == 4
    for line in lines("model_size"):
        check_row(by_dataset[line["dataset"]], line, columns("model_size"), line["basic_scenes"], rel=1e-6)


def test_sizes_are_sums_over_basic_scenes_not_over_seeds(tmp_path):
    sizes = {"geometry_mib": 1.0, "shading_mib": 0.5, "texture_mib": 8.0, "total_mib": 9.5}
    for tf in ("TF01", "TF02"):
        for seed in (0, 1):
            metrics(tmp_path, "texture", FitResult(60.0, 1000, sizes=sizes), "wood", tf, seed=seed)
    table = model_size(records(tmp_path))
    own = [paths for paths in sources(table) if paths]
    assert [[path.stem for path in paths] for paths in own] == [["0000", "0002"], ["0001", "0003"]]
    (first, second), theirs = parted(table)
    assert [first["recipe"], second["recipe"]] == ["quick", "quick-s1"]
    assert (first["basic scenes"], first["primitives"], first["texture MiB"]) == (2, 2000, 16.0)
    assert first["texture MiB (paper)"] == UNLIKE_CELL
    assert {row["data set"]: row for row in theirs}["wood"]["texture MiB"] == 114.5


@pytest.mark.parametrize("first", [(200, False), (800, True)], ids=["size", "changes"])
def test_no_mean_is_over_views_of_different_sizes_or_over_changes_of_a_recipe(tmp_path, first):
    others = (800, False)
    kinds = (("TF01", first, 40.0), ("TF02", others, 20.0), ("TF03", others, 30.0))
    for tf, (pixels, is_changed), psnr in kinds:
        result = FitResult(60.0, 9, psnr=psnr, width=pixels, height=pixels, train_views=92)
        metrics(tmp_path, "texture", result, "scan", tf, recipe_changed=is_changed)
    frame = fitting(records(tmp_path)).frame
    assert sorted(frame["PSNR"]) == [25.0, 40.0]
    assert sorted(frame["basic scenes"]) == [1, 2]
