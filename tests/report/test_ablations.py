import pytest

from tests.report.written import lines, metrics, records, rows
from texgs.report.fit_tables import RUNS, ablation
from texgs.report.results import FitResult
from texgs.report.table import UNLIKE

KEYS, TITLES = list(RUNS), [column.title for column in RUNS.values()]
VARIANTS = {"views": "views", "resolution": "image_px"}  # columns of the paper's files, by sweep


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
