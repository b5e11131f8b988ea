from dataclasses import replace

import pytest

from tests.report.written import lines, metrics, records, rows, sources
from texgs.report.fit_tables import model_size
from texgs.report.results import Comparison, FitResult, PseResult, TimingResult
from texgs.report.scene_tables import edits, rendering
from texgs.report.table import UNLIKE

GROUPS = {"geometry MiB": "geometry_mib", "shading MiB": "shading_mib", "texture MiB": "texture_mib"}
ALONE = TimingResult(4.0, 5.0, 4.0, primitives=9, width=8, height=6, threads=2)


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
    metrics(tmp_path, "pse", PseResult(6, [Comparison("a", 30.0, 0.9)], [Comparison("b")]))
    first, second = rows(edits(records(tmp_path)))
    assert (first["edit"], first["views"], first["PSNR"]) == ("a", 6, 30.0)
    assert (second["edit"], second["PSNR"]) == ("b", None)
