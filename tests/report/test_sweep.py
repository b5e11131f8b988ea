import json

import pytest

from texgs.core.errors import ArgumentError
from texgs.report.metrics_files import read
from texgs.report.sweep import sweep
from texgs.report.table import Table


def run(
    folder,
    variant,
    seed=0,
    psnr=30.0,
    phases=("surfels", "shading", "texture"),
    dataset="engine",
    sweep="mine",
):
    """Metrics files of one fit."""
    paths = []
    for phase in phases:
        path = folder / f"{dataset}-{variant}-{seed}-{phase}.json"
        numbers = {"fit_seconds": 60.0, "primitives": 1000}
        if phase == "texture":
            numbers |= {"psnr": psnr, "train_psnr": psnr + 1, "ssim": 0.9}
        if phase == "shading":
            numbers["material"] = dict.fromkeys(("ambient", "diffuse", "specular", "shininess"), 0.5)
        record = {"stage": phase, "dataset": dataset, "tf": "TF01", "recipe": "quick"}
        record |= {"variant": variant, "sweep": sweep}
        told = {"result": "FitResult", "numbers": numbers}
        path.write_text(json.dumps({**record, "seed": seed, "peak_memory_mib": 1024.0, **told}))
        paths.append(path)
    return paths


def column(table: Table, title):
    return [row.cells[[c.title for c in table.columns].index(title)] for row in table.rows]


def test_means_and_spread_over_seeds(tmp_path):
    paths = run(tmp_path, "a", 0, 30.0) + run(tmp_path, "a", 1, 32.0) + run(tmp_path, "b", 0, 20.0)
    table = sweep(read(paths), "mine")
    assert column(table, "variant") == ["a", "b"]
    assert column(table, "seeds") == [2, 1]
    assert column(table, "PSNR") == [31.0, 20.0]
    assert column(table, "PSNR, training") == [32.0, 21.0]
    assert column(table, "± PSNR") == [pytest.approx(2**0.5), None]
    assert column(table, "minutes") == [3.0, 3.0]
    assert column(table, "memory GiB") == [1.0, 1.0]
    assert "PSNR (paper)" not in [c.title for c in table.columns]


def test_numbers_of_the_paper_stand_beside_the_variants_of_its_data_set_in_their_order(tmp_path):
    options = {"dataset": "ionization", "sweep": "views"}
    paths = [path for name in ("162", "42", "92") for path in run(tmp_path, name, **options)]
    table = sweep(read(paths), "views")
    assert column(table, "variant") == ["42", "92", "162"]
    assert column(table, "PSNR (paper)") == [29.33, 30.95, 31.64]
    assert column(table, "primitives (paper)")[0] == 60172
    options = {"dataset": "supernova", "sweep": "resolution"}
    table = sweep(read(run(tmp_path, "400", **options) + run(tmp_path, "77", **options)), "resolution")
    assert column(table, "PSNR, training (paper)") == [None, 27.91], "77 is not the paper's"


def test_numbers_of_the_paper_do_not_stand_beside_another_data_set(tmp_path):
    table = sweep(read(run(tmp_path, "42", sweep="views")), "views")
    assert not [c.title for c in table.columns if "paper" in c.title]


def test_a_variant_with_a_missing_phase_is_not_measured(tmp_path):
    table = sweep(read(run(tmp_path, "a", phases=("shading",))), "mine")
    assert column(table, "seeds") == [0]
    assert set(table.rows[0].cells[5:]) == {None}


def test_fits_of_another_sweep_do_not_count_and_other_files_are_named(tmp_path):
    with pytest.raises(ArgumentError, match="sweep mine: no fit of it among the metrics files; run it first"):
        sweep(read(run(tmp_path, "a", sweep="other")), "mine")
    (tmp_path / "x.json").write_text("[]")
    with pytest.raises(ArgumentError, match=r"x\.json: expected the metrics of a job"):
        read([tmp_path / "x.json"])
