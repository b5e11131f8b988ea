import json
from dataclasses import replace

from texgs.report.metrics_files import read
from texgs.report.results import (
    Comparison,
    FitResult,
    PseResult,
    TimingResult,
    ViewsResult,
    VolumeResult,
    plain,
)
from texgs.report.scene_tables import datasets, edits, model_size, rendering


def metrics(folder, stage, result, *, dataset="engine", tf="TF01", **more):
    path = folder / f"{len(list(folder.iterdir())):03}.json"
    record = {"stage": stage, "dataset": dataset, "tf": tf, "recipe": "quick", "variant": "", "seed": 0}
    told = {"result": type(result).__name__, "numbers": plain(result)}
    path.write_text(json.dumps({**record, "device": "CPU", **more, **told}))


def rows(table):
    return [dict(zip([c.title for c in table.columns], row.cells, strict=True)) for row in table.rows]


def test_data_sets_by_size_of_their_views(tmp_path):
    lattice = {"spacing": [1.0] * 3, "origin": [0.0] * 3, "minimum": 0.0, "maximum": 1.0, "voxels": 120}
    metrics(tmp_path, "volume", VolumeResult([4, 5, 6], "uint8", **lattice, volume_mib=2.5))
    for tf, size, ms in (("TF01", 64, 10.0), ("TF02", 64, 30.0), ("TF01", 800, 500.0)):
        metrics(tmp_path, "views", ViewsResult(9, 2, size, size, frame_ms=ms), tf=tf)
    table = datasets(read(tmp_path.iterdir()))
    assert [[path.stem for path in row.sources] for row in table.rows] == [
        ["000", "001", "002"],
        ["000", "003"],
    ]
    small, large = rows(table)
    assert (small["views px"], small["basic scenes"], small["ms / frame"]) == ("64x64", 2, 20.0)
    assert (large["views px"], large["basic scenes"], large["ms / frame"]) == ("800x800", 1, 500.0)
    assert (small["samples"], small["volume MiB"]) == ("4x5x6", 2.5)
    assert (small["MiB (paper)"], small["ms / frame (paper)"]) == (32.0, 16.14)


def test_sizes_are_sums_over_basic_scenes_not_over_seeds(tmp_path):
    sizes = {"geometry_mib": 1.0, "shading_mib": 0.5, "texture_mib": 8.0, "total_mib": 9.5}
    result = FitResult(60.0, 1000, sizes=sizes)
    for tf in ("TF01", "TF02"):
        for seed in (0, 1):
            metrics(tmp_path, "texture", result, tf=tf, dataset="wood", seed=seed)
    table = model_size(read(tmp_path.iterdir()))
    assert [[path.stem for path in row.sources] for row in table.rows] == [["000", "002"], ["001", "003"]]
    found = rows(table)
    assert [row["recipe"] for row in found] == ["quick", "quick-s1"]
    assert (found[0]["basic scenes"], found[0]["primitives"], found[0]["texture MiB"]) == (2, 2000, 16.0)
    assert found[0]["texture MiB (paper)"] == 114.5


def test_frames_beside_those_of_the_volume(tmp_path):
    alone = TimingResult(4.0, 5.0, 4.0, primitives=9, width=8, height=6, threads=2)
    metrics(tmp_path, "timing", replace(alone, volume_mean_ms=100.0))
    metrics(tmp_path, "timing", alone, dataset="vortex", device="a GPU")
    first, second = rows(rendering(read(tmp_path.iterdir())))
    assert (first["volume / scene"], first["pixels"], first["mean ms"]) == (25.0, "8x6", 4.0)
    assert (second["volume / scene"], second["device"]) == (None, "a GPU")


def test_edits_with_and_without_a_volume(tmp_path):
    metrics(tmp_path, "pse", PseResult(6, [Comparison("a", 30.0, 0.9)], [Comparison("b")]))
    first, second = rows(edits(read(tmp_path.iterdir())))
    assert (first["edit"], first["views"], first["PSNR"]) == ("a", 6, 30.0)
    assert (second["edit"], second["PSNR"]) == ("b", None)
