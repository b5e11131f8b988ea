"""Benchmarks of labels on small volumes, whose rays and surfaces are known in closed form."""

import numpy as np
import pytest

from benchmarks import label_speed, label_surfaces, labels
from benchmarks.labels import FINE, OPACITY, Labelled
from tests.volume.march import march
from texgs.volume.caster import Caster
from texgs.volume.grid import Grid
from texgs.volume.settings import VolumeKeys

SIZE = 24  # samples and pixels


@pytest.fixture(scope="module")
def balls():
    return Labelled("balls", labels.balls(SIZE), [*labels.BALLS])


def test_balls_are_nested_and_open(balls):
    middle = balls.grid.values[:, SIZE // 2, SIZE // 2 - 1]
    inward = [int(each) for each in middle[: SIZE // 2]]
    assert [*dict.fromkeys(inward)] == [0, *labels.BALLS]
    assert not balls.grid.values[SIZE // 2 :, SIZE // 2 :, SIZE // 2 :].any()


def test_rays_meet_labels_and_pixels_have_weights_as_rays_in_torch_have(balls):
    camera = next(balls.cameras(SIZE, 1))
    caster, tfs = Caster(balls.binary, FINE), balls.of_masks
    alone = [march(balls.binary, tf, camera, FINE, labels.LIGHT).alpha > 0 for tf in tfs]
    met = labels.met_by(caster, tfs, camera)
    differ = [int((one != other).sum()) for one, other in zip(met, alone, strict=True)]
    assert max(differ) <= 1  # a ray that grazes
    assert [int(each.sum()) for each in met] == sorted((int(each.sum()) for each in met), reverse=True)
    weights, together = (
        labels.weights(caster, tfs, camera),
        march(balls.binary, tfs, camera, FINE, labels.LIGHT),
    )
    assert np.allclose(weights.sum(0), together.alpha, atol=1e-3)


def test_masks_show_no_false_label_and_numbers_show_many(balls):
    masks, numbers, suggested = labels.measured(balls, SIZE, 2)
    assert masks["not met %"] < 0.1 < 10 < min(numbers["not met %"], suggested["not met %"])
    assert masks["another %"] < numbers["another %"]


def test_surfaces_of_masks_are_within_half_a_voxel(balls):
    rows = label_surfaces.measured(balls, 500)
    assert [row["label"] for row in rows] == balls.numbers
    assert all(0 < row[f"99 % {way}"] < 0.5 for row in rows for way in ("to the binary mask", "and back"))


def test_distances_are_those_of_planes():
    slab = np.zeros((6, 40, 40), np.uint8)
    slab[2:4] = 255
    thick = np.zeros_like(slab)
    thick[1:5] = 255
    meshes = label_surfaces.surface(slab), label_surfaces.surface(thick)
    found = label_surfaces.distances(*meshes, 500)
    assert np.median(found) == pytest.approx(1.0, abs=1e-6)
    assert label_surfaces.distances(meshes[0], meshes[0], 500).max() < 1e-5


def test_speed_of_labels_is_told(balls, tmp_path):
    section = label_speed.views(balls, SIZE, 1)
    names = [m.parameters["labels"] for m in section.measurements if m.unit == "ms"]
    assert names == ["all", "all, as numbers", *map(str, balls.numbers)]
    assert {m.name for m in section.measurements} == {"view", "all / the slowest", "all / numbers"}
    assert all(m.min > 0 for m in section.measurements)


def test_masks_are_made_in_a_process_of_their_own(tmp_path):
    dims = (48, 40, 32)
    file = label_speed.made_file(tmp_path, dims)
    values = np.fromfile(file, "<u2").reshape(dims[::-1])
    assert [*np.unique(values)] == [*range(11)]
    time, memory = label_speed.masks(file, VolumeKeys(dims=[*dims], dtype="uint16"), [1, 10])
    assert time.parameters == memory.parameters == {"file": "labels.raw", "masks": 2}
    assert time.median > 0
    assert 10 < memory.median < 4000


def test_labels_of_files_are_the_largest_and_at_most_ten(tmp_path, monkeypatch):
    from texgs.volume.nrrd_file import write_header

    values = np.zeros((4, 8, 16), np.uint8)
    for label in range(1, 13):
        values[:, :, label] = label
    values[0, 0, 3], values[0, :, 5] = 0, 0
    grid = Grid(values)
    with (tmp_path / "some.nrrd").open("wb") as file:
        write_header(file, grid.dims, values.dtype, grid.spacing, grid.origin, grid.space, 1)
        file.write(values.tobytes())
    monkeypatch.setenv("TEXGS_DATA", str(tmp_path))
    balls, some = labels.volumes(["some.nrrd"])
    assert (balls.name, some.name, len(some.numbers)) == ("balls", "some", 10)
    assert not {3, 5} & {*some.numbers}
    assert some.of_masks[1].opacity == ((127.5, OPACITY), (255, OPACITY))
