import csv
import io
import json
from pathlib import Path

import pytest

from texgs.cli.main import main
from texgs.core.errors import ArgumentError
from texgs.report.fitting import COLUMNS, fitting
from texgs.report.metrics_files import paper, read
from texgs.report.table import Column, Row, Table

TABLE = Table(
    "A caption.",
    (Column("name"), Column("dB", 2)),
    (Row(("five_jets", 36.834), (Path("a/metrics.json"),)), Row(("wood & stone", None), ())),
)


def test_csv_keeps_all_digits_and_leaves_gaps():
    assert list(csv.reader(io.StringIO(TABLE.csv()))) == [
        ["name", "dB", "metrics files"],
        ["five_jets", "36.834", "a/metrics.json"],
        ["wood & stone", "", ""],
    ]


def test_markdown_and_latex_say_what_was_not_measured():
    assert "| five_jets | 36.83 |" in TABLE.markdown()
    assert "| wood & stone | not measured |" in TABLE.markdown()
    assert r"five\_jets & 36.83 \\" in TABLE.latex()
    assert r"wood \& stone & not measured \\" in TABLE.latex()


def metrics(folder, dataset, recipe, phase, **numbers):
    path = folder / dataset / "TF01" / recipe / phase / "metrics.json"
    path.parent.mkdir(parents=True)
    numbers = {"fit_seconds": 90.0, "primitives": 1234, **numbers}
    record = {"stage": phase, "dataset": dataset, "tf": "TF01", "recipe": recipe, "peak_memory_mib": 512.0}
    path.write_text(json.dumps({**record, "result": "FitResult", "numbers": numbers}))
    return path


def test_fitting_stands_beside_the_paper(tmp_path):
    paths = [metrics(tmp_path, "engine", "default", "texture", psnr=40.0, ssim=0.99)]
    paths.append(metrics(tmp_path, "engine", "default", "surfels"))
    paths.append(metrics(tmp_path, "sphere", "quick", "shading", psnr=30.0, ssim=0.9))
    table = fitting(read(paths))
    assert [row.cells[:4] for row in table.rows] == [
        ["engine", "TF01", "default", "surfels"],
        ["engine", "TF01", "default", "texture"],
        ["sphere", "TF01", "quick", "shading"],
    ]
    last = dict(zip([column.title for column in COLUMNS], table.rows[1].cells, strict=True))
    assert last["minutes"] == 1.5
    assert last["memory GiB"] == 0.5
    assert (last["PSNR (paper)"], last["minutes (paper)"]) == (33.29, 0.76)
    assert table.rows[0].cells[4] is None, "no test views were compared"
    assert table.rows[2].cells[-3:] == [None, None, None], "the paper does not have it"


def test_the_papers_numbers_are_all_there():
    published = paper("fitting", keys=2)
    assert len(published) == 8 * 3
    assert float(published["supernova", "shading"]["psnr"]) == 29.34


def test_the_verb_writes_three_files_a_table(tmp_path, capsys):
    path = metrics(tmp_path, "engine", "default", "shading", psnr=40.0, ssim=0.99)
    assert main(["tables", str(path), "--output", str(tmp_path / "tables")]) == 0
    assert sorted(file.name for file in (tmp_path / "tables").iterdir()) == [
        f"{name}.{kind}"
        for name in ("datasets", "edits", "fitting", "looks", "meshes", "model_size", "rendering")
        for kind in ("csv", "md", "tex")
    ]
    assert "| engine | TF01 | default | shading | 40.00 |" in capsys.readouterr().out


def test_a_file_that_is_no_metrics_is_named(tmp_path):
    (tmp_path / "a.json").write_text("[]")
    with pytest.raises(ArgumentError, match=r"a\.json: expected the metrics of a job"):
        read([tmp_path / "a.json"])
    old = {"stage": "texture", "dataset": "engine", "numbers": {"fit_seconds": 1.0, "surfels": 9}}
    (tmp_path / "a.json").write_text(json.dumps(old))
    with pytest.raises(ArgumentError, match="of this version of texgs, got others; run the job again"):
        read([tmp_path / "a.json"])
