"""Films of several scenes in step."""

import av
import numpy as np
import pytest
import torch

from tests.fields.voxels.test_voxels import ball
from texgs.core.lens import Frame
from texgs.fields.voxels import write_voxels
from texgs.scene.scene import Scene, SceneModel
from texgs.study.ballot_page import cell, mosaic, write_film


@pytest.mark.parametrize("count", range(1, 12))
def test_each_scene_has_its_cell(count):
    pictures = [np.full((4, 4, 3), 10 * index, dtype=np.uint8) for index in range(count)]
    whole = mosaic(pictures)
    for index, picture in enumerate(pictures):
        column, row = cell(index, count)
        assert np.array_equal(whole[4 * row : 4 * row + 4, 4 * column : 4 * column + 4], picture)
    assert (whole == 255).all(axis=2).sum() == whole.shape[0] * whole.shape[1] - 16 * count
    assert whole.shape[0] <= whole.shape[1] <= 16


def test_scenes_turn_side_by_side_and_fill_their_cells(tmp_path):
    """Balls of another colour each: the cells hold them in their order, all at the same place."""
    scenes = []
    for name, color in (("dark", -1.5), ("grey", 0.0), ("bright", 1.0)):
        path = write_voxels(tmp_path / f"{name}.safetensors", ball(color=color))
        scenes.append(Scene({"TF01": SceneModel(path)}, frame=Frame([0.0, 0.0, 0.0], 0.2)))
    path = write_film(tmp_path / "film.mp4", scenes, 64, 3, torch.device("cpu"), "test")
    with av.open(str(path)) as film:
        stream = film.streams.video[0]
        assert float(stream.average_rate) == 25
        frames = [frame.to_ndarray(format="rgb24") for frame in film.decode(stream)]
    assert [frame.shape for frame in frames] == [(128, 128, 3)] * 3
    for frame in frames:
        cells = [frame[:64, :64], frame[:64, 64:], frame[64:, :64]]
        middles = [each[28:36, 28:36].mean() for each in cells]
        assert middles == sorted(middles)
        assert middles[0] < 60 < middles[1] < 170 < middles[2]
        width = (cells[0].mean(axis=2)[32] < 128).sum()
        assert 64 / 1.1 - 8 < width < 64  # softened at its edge, and by the film
        assert frame[64:, 64:].min() > 245, "an empty cell is white"
