import math

import numpy as np
import pytest
import torch
from plyfile import PlyData, PlyElement

from tests.fields.surfels.ply_files import columns_of, write_vertices
from tests.fields.surfels.samples import STAGES, same, sample
from tests.real_data import real_data
from texgs.core.errors import ArgumentError, TexgsError
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.ply import read_ply, write_ply


def test_text_other_orders_and_doubles_are_read(tmp_path):
    model = sample("surfels", degree=1)
    columns = columns_of(write_ply(tmp_path / "m.ply", model))
    mixed = dict(sorted(columns.items(), reverse=True)) | {"label": np.arange(7)}
    for kind in ({"text": True}, {"byte_order": ">"}):
        assert same(read_ply(write_vertices(tmp_path / "o.ply", mixed, **kind)), model)
    array = np.zeros(7, [(name, "f8") for name in columns])
    for name, column in columns.items():
        array[name] = column
    PlyData([PlyElement.describe(array, "vertex")]).write(tmp_path / "d.ply")
    assert same(read_ply(tmp_path / "d.ply"), model)


def test_the_release_clamps_colours_at_zero(tmp_path):
    path = write_ply(tmp_path / "m.ply", sample("shading", material="paper"), "release")
    dark = write_vertices(path, columns_of(path, f_dc_1=np.full(7, -3.0)))
    assert not read_ply(dark).parameters["colors"][:, 1].any()


def test_what_a_flavour_cannot_express(tmp_path):
    path = tmp_path / "m.ply"
    with pytest.raises(ArgumentError, match="flavour: expected 2dgs, 3dgs, release, got '4dgs'"):
        write_ply(path, sample(), "4dgs")
    with pytest.raises(ArgumentError, match="release needs a model with shading, got stage surfels"):
        write_ply(path, sample("surfels"), "release")
    model = sample("shading", shared=True)
    sharp = Surfels({**model.parameters, "shininess": torch.tensor([3.0])}, model.shading)
    with pytest.raises(ArgumentError, match=r"shininess: expected less than 50.*got up to 95\.3"):
        write_ply(path, sharp, "release")
    bad = Surfels({**model.parameters, "means": torch.full((7, 3), math.nan)})
    with pytest.raises(ArgumentError, match="means: expected finite values, got 21 NaN"):
        write_ply(path, bad)
    assert list(tmp_path.iterdir()) == []


def test_volumes_of_3dgs_are_refused(tmp_path):
    path = write_ply(tmp_path / "m.ply", sample("surfels"), "3dgs")
    write_vertices(path, columns_of(path, scale_2=np.r_[np.full(4, -4.0), np.full(3, -13.0)]))
    with pytest.raises(ArgumentError, match="expected flat Gaussians, got 4 of 7 with a third axis"):
        read_ply(path)


def test_points_without_surfels_are_named(tmp_path):
    path = write_vertices(tmp_path / "points.ply", {name: [0.0] for name in ("x", "y", "z", "red")})
    with pytest.raises(ArgumentError, match=r"points\.ply: .* a number scale_0 each, got x, y, z, red"):
        read_ply(path)
    face = PlyElement.describe(np.zeros(1, [("a", "i4")]), "face")
    PlyData([face]).write(path)
    with pytest.raises(ArgumentError, match="expected vertices, got face"):
        read_ply(path)


def test_a_point_cloud_of_the_papers_data_is_no_model():
    with pytest.raises(ArgumentError, match="expected vertices with a number scale_0 each, got x, y, z, nx"):
        read_ply(real_data("vortex/TF01/points3d.ply"))


@pytest.mark.parametrize("name", ["y", "opacity", "scale_1", "rot_3", "f_dc_1"])
def test_a_property_that_misses_is_named(tmp_path, name):
    path = write_ply(tmp_path / "m.ply", sample("surfels"))
    write_vertices(path, columns_of(path, **{name: None}))
    with pytest.raises(ArgumentError, match=f"a number {name} each"):
        read_ply(path)


def test_a_number_of_harmonics_that_cannot_be(tmp_path):
    path = write_ply(tmp_path / "m.ply", sample("surfels"))
    write_vertices(path, columns_of(path, f_rest_7=None))
    with pytest.raises(ArgumentError, match="expected 0, 9, 24 or 45 properties f_rest, got 44"):
        read_ply(path)


def test_values_that_are_not_finite(tmp_path):
    path = write_ply(tmp_path / "m.ply", sample("surfels"))
    write_vertices(path, columns_of(path, z=np.full(7, np.nan)))
    with pytest.raises(ArgumentError, match="means: expected finite values, got 7 NaN"):
        read_ply(path)


def test_lists_are_no_numbers(tmp_path):
    array = np.empty(1, [("x", object), ("scale_0", "f4"), ("scale_1", "f4")])
    array[0] = (np.zeros(2, np.float32), 0, 0)
    PlyData([PlyElement.describe(array, "vertex")]).write(tmp_path / "m.ply")
    with pytest.raises(ArgumentError, match="a number x each"):
        read_ply(tmp_path / "m.ply")


@pytest.mark.parametrize("stage", STAGES)
@pytest.mark.parametrize("kept", [0, 0.05, 0.5, 0.999])
def test_a_file_cut_anywhere_is_refused(tmp_path, stage, kept):
    path = write_ply(tmp_path / "m.ply", sample(stage))
    data = path.read_bytes()
    path.write_bytes(data[: int(kept * len(data))])
    with pytest.raises(ArgumentError, match="expected a whole PLY file"):
        read_ply(path)


def test_files_that_are_no_ply_are_named(tmp_path):
    with pytest.raises(ArgumentError, match="none: no such file"):
        read_ply(tmp_path / "none")
    with pytest.raises(ArgumentError, match="got a folder"):
        read_ply(tmp_path)
    path = tmp_path / "m.ply"
    for content in (
        b"hello",
        bytes(range(256)),
        b"ply\nformat ascii 1.0\nelement vertex -5\nproperty float x\nend_header\n",
    ):
        path.write_bytes(content)
        with pytest.raises(TexgsError, match="expected a whole PLY file"):
            read_ply(path)
