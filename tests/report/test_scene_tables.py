from dataclasses import replace

from tests.report.written import lines, metrics, records, rows, sources
from texgs.report.results import (
    PseResult,
    SheetResult,
    StepsResult,
    TimingResult,
    ViewComparison,
    ViewsResult,
    VolumeResult,
)
from texgs.report.scene_tables import datasets, edits, rendering, steps
from texgs.report.table import UNLIKE_CELL

LATTICE = {"spacing": [1.0] * 3, "origin": [0.0] * 3, "minimum": 0.0, "maximum": 1.0, "voxels": 120}
ALONE = TimingResult(4.0, 5.0, 4.0, primitives=9, width=8, height=6, threads=2)


def test_frames_beside_those_of_the_volume(tmp_path):
    metrics(tmp_path, "timing", replace(ALONE, volume_mean_ms=100.0))
    metrics(tmp_path, "timing", ALONE, dataset="vortex", device="a GPU")
    first, second, *theirs = rows(rendering(records(tmp_path)))
    assert (first["volume / scene"], first["pixels"], first["mean ms"]) == (25.0, "8x6", 4.0)
    assert (second["volume / scene"], second["device"]) == (None, "a GPU")
    assert [row["mean ms"] for row in theirs] == [11.82, 7.21]


def test_frames_have_means_without_stand_ins_and_the_volumes_of_the_paper_at_its_size(tmp_path):
    for dataset, ms in (("engine", 4.0), ("beetle", 6.0)):
        timing = replace(ALONE, frame_mean_ms=ms, width=512, height=512)
        metrics(tmp_path, "timing", timing, dataset=dataset)
    metrics(tmp_path, "timing", replace(timing, frame_mean_ms=50.0), "jets", stand_in="engine")
    by_dataset = {row["data set"]: row for row in rows(rendering(records(tmp_path)))}
    assert by_dataset["engine"]["volume, ms (paper)"] == 16.14
    assert by_dataset["jets, stand-in for engine"]["volume, ms (paper)"] is None
    assert by_dataset["mean of 2"]["mean ms"] == 5.0


def test_edits_with_and_without_a_volume(tmp_path):
    metrics(tmp_path, "pse", PseResult(6, [ViewComparison("a", 30.0, 0.9)], [ViewComparison("b")]))
    first, second = rows(edits(records(tmp_path)))
    assert (first["edit"], first["views"], first["PSNR"]) == ("a", 6, 30.0)
    assert (second["edit"], second["PSNR"]) == ("b", None)


def test_steps_of_sweeps_are_not_among_those_of_data_sets(tmp_path):
    result = StepsResult(20, 6, 0.5, [ViewComparison("a", 34.0, 0.9), ViewComparison("b", 36.0, 0.9)], 3.0)
    metrics(tmp_path, "steps", result)
    metrics(tmp_path, "steps", replace(result, step_mib=9.0), sweep="mine", variant="a")
    (row,) = rows(steps(records(tmp_path)))
    assert (row["PSNR"], row["PSNR of the worst step"], row["MiB / step"]) == (35.0, 34.0, 0.5)


def test_data_sets_by_size_of_their_views(tmp_path):
    metrics(tmp_path, "volume", VolumeResult([4, 5, 6], "uint8", **LATTICE, volume_mib=2.5))
    for tf, size, ms in (("TF01", 64, 10.0), ("TF02", 64, 30.0), ("TF01", 512, 500.0)):
        metrics(tmp_path, "views", ViewsResult(9, 2, size, size, frame_ms=ms, vtk_frame_ms=30 * ms), tf=tf)
    table = datasets(records(tmp_path))
    by_size = {row["image, pixels"]: row for row in rows(table)}
    small, large = by_size["64x64"], by_size["512x512"]
    assert (small["basic scenes"], small["ms / frame"]) == (2, 20.0)
    assert (large["basic scenes"], large["ms / frame"]) == (1, 500.0)
    assert (small["VTK, ms / frame"], large["VTK, ms / frame"]) == (600.0, 15000.0)
    assert (small["volume, samples"], small["volume MiB"]) == ("4x5x6", 2.5)
    assert (small["samples (paper)"], small["MiB (paper)"]) == ("256x256x128", 32.0)
    assert (small["ms / frame (paper)"], large["ms / frame (paper)"]) == (UNLIKE_CELL, 16.14)
    files = [[path.stem for path in paths] for paths in sources(table)]
    assert sorted(files) == [["0000", "0001", "0002"], ["0000", "0003"]]


def test_data_sets_are_in_the_papers_order_and_stand_ins_below(tmp_path):
    names = [line["dataset"] for line in lines("datasets")]
    views = ViewsResult(9, 2, 800, 800, frame_ms=1.0)
    for name in [*sorted(names), "another"]:
        metrics(tmp_path, "views", views, name, "TF01")
    metrics(tmp_path, "views", views, "jets", "TF01", stand_in="five jets")
    entries = rows(datasets(records(tmp_path)))
    expected = [names[0], "jets, stand-in for five jets", *names[1:], "another"]
    assert [row["data set"] for row in entries] == expected
    assert [entries[1][c] for c in ("samples (paper)", "MiB (paper)", "ms / frame (paper)")] == [None] * 3


def test_published_views_have_a_row_without_a_volume(tmp_path):
    for tf in ("TF01", "TF04"):
        metrics(tmp_path, "sheet", SheetResult(92, 181, 800, 800), "vortex", tf)
    (row,) = rows(datasets(records(tmp_path)))
    assert (row["image, pixels"], row["basic scenes"], row["volume, samples"]) == ("800x800", 2, None)
    assert row["basic scenes (paper)"] == 1
