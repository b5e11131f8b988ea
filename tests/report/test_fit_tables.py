from dataclasses import replace

import pytest

from tests.report.written import lines, metrics, records, rows, sources
from texgs.report.fit_tables import RUNS, ablation, fits, fitting, model_size
from texgs.report.results import FitResult
from texgs.report.table import UNLIKE

MEASURES = {
    "PSNR": "psnr",
    "SSIM": "ssim",
    "minutes": "minutes",
    "CPU GiB": "cpu_gb",
    "GPU GiB": "gpu_gb",
    "primitives": "primitives",
}
SIZES = {line["dataset"]: line for line in lines("datasets")}
KEYS, TITLES = list(RUNS), [column.title for column in RUNS.values()]
VARIANTS = {"views": "views", "resolution": "image_px"}  # columns of the paper's files, by sweep
GROUPS = {"geometry MiB": "geometry_mib", "shading MiB": "shading_mib", "texture MiB": "texture_mib"}


def phase_of(line, factor, **more):
    """A phase whose measures are some multiple of the paper's."""
    pixels = int(SIZES[line["dataset"]]["image_px"])
    return FitResult(
        60 * line["minutes"] * factor,
        round(line["primitives"] * factor),
        psnr=line["psnr"] * factor,
        ssim=line["ssim"] * factor,
        peak_gpu_memory_mib=1024 * line["gpu_gb"] * factor,
        **{"train_views": 162, "width": pixels, "height": pixels} | more,
    )


def write_paper(folder):
    """Metrics whose means are the paper's numbers: 10 % above and below where a data set has two scenes."""
    for line in lines("fitting"):
        scenes = int(SIZES[line["dataset"]]["basic_scenes"])
        for index, factor in enumerate([1.0] if scenes == 1 else [0.9, 1.1]):
            metrics(
                folder,
                line["phase"],
                phase_of(line, factor),
                line["dataset"],
                f"TF{index}",
                recipe="paper",
                peak_memory_mib=1024 * line["cpu_gb"] * factor,
            )


def test_means_of_the_papers_basic_scenes_are_the_papers_rows(tmp_path):
    write_paper(tmp_path)
    entries, expected = rows(fitting(records(tmp_path))), lines("fitting")
    assert [(row["data set"], row["phase"]) for row in entries] == [
        (line["dataset"], line["phase"]) for line in expected
    ]
    for row, line in zip(entries, expected, strict=True):
        assert row["recipe"] == "paper"
        assert row["basic scenes"] == SIZES[line["dataset"]]["basic_scenes"]
        for title, key in MEASURES.items():
            assert row[title] == pytest.approx(line[key], rel=2e-5), "primitives are whole numbers"
            assert row[f"{title} (paper)"] == line[key]


def test_other_recipes_and_sizes_have_a_sign_and_the_paper_rows_of_its_own(tmp_path):
    line = next(line for line in lines("fitting") if line["dataset"] == "engine")
    result = phase_of(line, 1.0)
    for recipe, changed in (
        ("quick", result),
        ("paper", replace(result, width=400)),
        ("paper", replace(result, train_views=92)),
        ("paper", replace(result, width=None, height=None)),
    ):
        path = metrics(tmp_path, "surfels", changed, tf="TF01", recipe=recipe)
        table = fitting(records(tmp_path))
        own = [row for row in rows(table) if row["recipe"] != "the paper"]
        assert [row["PSNR (paper)"] for row in own] == [UNLIKE]
        assert own[0]["PSNR"] == line["psnr"]
        theirs = [row for row in rows(table) if row["recipe"] == "the paper"]
        assert len(theirs) == 24
        assert [row["PSNR"] for row in theirs if row["data set"] == "engine"] == [30.15, 33.25, 33.29]
        assert "not like for like" in table.caption
        path.unlink()


def test_a_variant_of_the_recipe_is_not_the_recipe(tmp_path):
    line = next(line for line in lines("fitting") if line["dataset"] == "engine")
    metrics(tmp_path, "surfels", phase_of(line, 1.0), tf="TF01", recipe="paper", variant="hand")
    metrics(tmp_path, "surfels", phase_of(line, 1.0), tf="TF02", recipe="paper", recipe_changed=True)
    own = [row for row in rows(fitting(records(tmp_path))) if row["recipe"] in ("paper", "paper-hand")]
    assert [row["PSNR (paper)"] for row in own] == [UNLIKE, UNLIKE]


def test_data_that_the_paper_does_not_have_stand_alone(tmp_path):
    metrics(tmp_path, "surfels", FitResult(60.0, 9, psnr=30.0), "scan", "TF01")
    (row,) = rows(fitting(records(tmp_path)))
    assert (row["data set"], row["PSNR"], row["PSNR (paper)"]) == ("scan", 30.0, None)


def test_a_stand_in_has_a_row_of_its_own_without_the_papers_numbers(tmp_path):
    line = next(line for line in lines("fitting") if line["dataset"] == "five_jets")
    metrics(tmp_path, "surfels", phase_of(line, 1.0), "jets", "TF01", recipe="paper", stand_in="five jets")
    entries = rows(fitting(records(tmp_path)))
    assert [row["data set"] for row in entries[:4]] == ["five_jets"] * 3 + ["jets, stand-in for five jets"]
    assert [row["recipe"] for row in entries[:4]] == ["the paper"] * 3 + ["paper"]
    assert [entries[3][f"{title} (paper)"] for title in MEASURES] == [None] * 6


def test_a_measure_that_a_basic_scene_lacks_has_no_mean(tmp_path):
    metrics(tmp_path, "shading", FitResult(60.0, 10, psnr=30.0), "scan", "TF01")
    metrics(tmp_path, "shading", FitResult(120.0, 20), "scan", "TF02")
    (row,) = rows(fitting(records(tmp_path)))
    assert (row["PSNR"], row["minutes"], row["primitives"]) == (None, 1.5, 15)


def test_phases_of_a_field_that_is_not_here_any_more_are_shown(tmp_path):
    metrics(tmp_path, "ball", FitResult(60.0, 9), "scan", "TF01", field="ball")
    metrics(tmp_path, "texture", FitResult(60.0, 9), "scan", "TF01")
    assert [row["phase"] for row in rows(fitting(records(tmp_path)))] == ["texture", "ball"]


def test_fits_are_listed_one_by_one_but_for_those_of_sweeps(tmp_path):
    for tf in ("TF02", "TF01"):
        for phase in ("texture", "shading"):
            metrics(tmp_path, phase, FitResult(90.0, 7), tf=tf)
    metrics(tmp_path, "texture", FitResult(90.0, 7), tf="TF01", sweep="views", variant="42")
    entries = rows(fits(records(tmp_path)))
    assert [(row["TF"], row["phase"]) for row in entries] == [
        ("TF01", "shading"),
        ("TF01", "texture"),
        ("TF02", "shading"),
        ("TF02", "texture"),
    ]
    assert {row["minutes"] for row in entries} == {1.5}
    assert all("42" not in row["recipe"] for row in rows(fitting(records(tmp_path))))


def write_fit(folder, line, sweep, factor=1.0, dataset=None, recipe="paper", tf="TF01", name="", **facts):
    """Metrics of a fit, whose measures are some multiple of the paper's; its phases share the minutes."""
    variant = int(line[VARIANTS[sweep]])
    pixels, views = (512, variant) if sweep == "views" else (variant, 162)
    for phase in ("surfels", "shading", "texture"):
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
        named = {"sweep": name or sweep, "variant": str(variant)} | facts
        metrics(folder, phase, result, dataset or line["dataset"], tf, recipe, **named)


@pytest.mark.parametrize("sweep", list(VARIANTS))
def test_means_of_the_papers_basic_scenes_and_seeds_are_the_papers_rows(tmp_path, sweep):
    for line in lines(sweep):
        for tf, factor in (("TF01", 0.9), ("TF02", 1.1)):
            for seed, more in ((0, 0.05), (1, -0.05)):
                write_fit(tmp_path, line, sweep, factor + more, tf=tf, seed=seed)
    entries, expected = rows(ablation(records(tmp_path), sweep)), lines(sweep)
    assert len(entries) == len(expected)
    for row, line in zip(entries, expected, strict=True):
        assert row["recipe"] == "paper"
        assert row["basic scenes"] == 2
        for title, key in zip(TITLES, KEYS, strict=True):
            assert row[title] == pytest.approx(line[key], rel=2e-5), "primitives are whole numbers"
            assert row[f"{title} (paper)"] == line[key]


@pytest.mark.parametrize("changed", [{"recipe": "quick"}, {"dataset": "engine"}, {"stand_in": "ionization"}])
def test_what_is_not_like_for_like_stands_above_the_papers_rows(tmp_path, changed):
    write_fit(tmp_path, lines("views")[0], "views", **changed)
    entries = rows(ablation(records(tmp_path), "views"))
    (own,) = [row for row in entries if row["recipe"] != "the paper"]
    theirs = [row for row in entries if row["recipe"] == "the paper"]
    assert own["PSNR (paper)"] in (UNLIKE, None)
    assert [row["training views"] for row in theirs] == ["42", "92", "162", "252"]
    assert [row["PSNR"] for row in theirs] == [29.33, 30.95, 31.64, 31.71]


def test_a_fit_with_a_missing_phase_is_not_measured(tmp_path):
    write_fit(tmp_path, lines("views")[0], "views")
    write_fit(tmp_path, lines("views")[0], "views", tf="TF02")
    sorted(tmp_path.iterdir())[-1].unlink()
    own = rows(ablation(records(tmp_path), "views"))[0]
    assert [own[title] for title in TITLES] == [None] * 6
    assert own["PSNR (paper)"] == UNLIKE


def test_other_sweeps_do_not_count_but_for_their_like(tmp_path):
    write_fit(tmp_path, lines("views")[0], "views", dataset="scan")
    write_fit(tmp_path, lines("views")[0], "views", dataset="other", name="views_quick")
    write_fit(tmp_path, lines("views")[0], "views", dataset="third", name="viewshed")
    assert [row["data set"] for row in rows(ablation(records(tmp_path), "views"))] == ["other", "scan"]
    assert ablation(records(tmp_path), "resolution").is_empty


def test_sums_over_the_papers_basic_scenes_are_the_papers_sizes(tmp_path):
    pixels = {line["dataset"]: int(line["image_px"]) for line in lines("datasets")}
    for line in lines("model_size"):
        scenes, size = int(line["basic_scenes"]), pixels[line["dataset"]]
        seen = {"train_views": 162, "width": size, "height": size}
        for index in range(scenes):
            sizes = {group: line[group] / scenes for group in GROUPS.values()}
            count = round(line["primitives"] / scenes)
            result = FitResult(60.0, count, sizes=sizes, **seen)
            metrics(tmp_path, "texture", result, line["dataset"], f"TF{index}", "paper")
    by_dataset = {row["data set"]: row for row in rows(model_size(records(tmp_path)))}
    assert len(by_dataset) == len(model_size(records(tmp_path)).rows) == 4
    for line in lines("model_size"):
        row = by_dataset[line["dataset"]]
        assert row["basic scenes"] == line["basic_scenes"]
        for title, key in (GROUPS | {"primitives": "primitives"}).items():
            assert row[title] == pytest.approx(line[key])
            assert row[f"{title} (paper)"] == line[key]


def test_sizes_are_sums_over_basic_scenes_not_over_seeds(tmp_path):
    sizes = {"geometry_mib": 1.0, "shading_mib": 0.5, "texture_mib": 8.0, "total_mib": 9.5}
    result = FitResult(60.0, 1000, sizes=sizes)
    for tf in ("TF01", "TF02"):
        for seed in (0, 1):
            metrics(tmp_path, "texture", result, tf=tf, dataset="wood", seed=seed)
    table = model_size(records(tmp_path))
    own = [paths for paths in sources(table) if paths]
    assert [[path.stem for path in paths] for paths in own] == [["0000", "0002"], ["0001", "0003"]]
    ours = [row for row in rows(table) if row["recipe"] != "the paper"]
    assert [row["recipe"] for row in ours] == ["quick", "quick-s1"]
    assert (ours[0]["basic scenes"], ours[0]["primitives"], ours[0]["texture MiB"]) == (2, 2000, 16.0)
    assert ours[0]["texture MiB (paper)"] == UNLIKE
    theirs = {row["data set"]: row for row in rows(table) if row["recipe"] == "the paper"}
    assert theirs["wood"]["texture MiB"] == 114.5
