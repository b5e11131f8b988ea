"""PLY files of other programs: what is read of them, and how they are refused."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from plyfile import PlyData, PlyElement

from tests.fields.gaussians.samples import sample as gaussians
from tests.fields.surfels.ply_files import columns_of, write_vertices
from tests.fields.surfels.samples import same
from tests.fields.surfels.samples import sample as surfels
from tests.real_data import real_data
from tests.refusals import refused
from texgs.core.errors import TexgsError
from texgs.core.ply_file import read_vertices
from texgs.fields import gaussians as files
from texgs.fields.surfels import ply

KINDS = {"surfels": (lambda: surfels("surfels"), ply), "gaussians": (gaussians, files)}


@pytest.fixture(params=KINDS)
def written(request, tmp_path):
    """A model, its file, and what reads such files."""
    make, module = KINDS[request.param]
    return make(), module.write_ply(tmp_path / "m.ply", make()), module.read_ply


def test_text_other_orders_and_doubles_are_read(written, tmp_path):
    model, path, read_ply = written
    columns = columns_of(path)
    mixed = dict(sorted(columns.items(), reverse=True)) | {"label": np.arange(7)}
    for kind in ({"text": True}, {"byte_order": ">"}):
        assert same(read_ply(write_vertices(tmp_path / "o.ply", mixed, **kind)), model)
    array = np.zeros(7, [(name, "f8") for name in columns])
    for name, column in columns.items():
        array[name] = column
    PlyData([PlyElement.describe(array, "vertex")]).write(tmp_path / "d.ply")
    assert same(read_ply(tmp_path / "d.ply"), model)


def test_there_may_be_fewer_harmonics(written):
    model, path, read_ply = written
    write_vertices(path, columns_of(path, **{f"f_rest_{k}": None for k in range(45)}))
    assert torch.equal(read_ply(path).parameters["sh"], model.parameters["sh"][:, :1])


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        *(({name: None}, f"a number {name} each") for name in ("y", "opacity", "scale_1", "rot_3", "f_dc_1")),
        ({"f_rest_44": None}, "f_rest, got 44"),
        ({"rot_3": np.full(7, np.nan)}, "quats: .*7 NaN"),
    ],
)
def test_what_is_no_model_is_named(written, changes, named):
    _, path, read_ply = written
    write_vertices(path, columns_of(path, **changes))
    refused(lambda: read_ply(path), f"^{path}: .*{named}")


def test_files_that_are_no_ply_or_cut_are_named(written, tmp_path):
    _, path, read_ply = written
    refused(lambda: read_ply(tmp_path / "none"), "none: no such file")
    refused(lambda: read_ply(tmp_path), "got a folder")
    whole = path.read_bytes()
    negative = b"ply\nformat ascii 1.0\nelement vertex -5\nproperty float x\nend_header\n"
    for content in (b"hello", bytes(range(256)), negative, *(whole[: len(whole) * k // 9] for k in range(9))):
        path.write_bytes(content)
        refused(lambda: read_ply(path), f"{path}: expected a whole PLY file", TexgsError)
    lists = np.empty(1, [("x", object), ("scale_0", "f4"), ("scale_1", "f4"), ("scale_2", "f4")])
    lists[0] = (np.zeros(2, np.float32), 0, 0, -20)
    for values, kind, named in (
        (np.zeros(1, [("a", "i4")]), "face", "got face"),
        (lists, "vertex", "number x"),
    ):
        PlyData([PlyElement.describe(values, kind)]).write(path)
        refused(lambda: read_ply(path), named)


@pytest.mark.parametrize("kind", [{"text": True}, {"byte_order": "<"}, {"byte_order": ">"}])
def test_vertices_may_come_after_others(written, tmp_path, kind):
    model, path, read_ply = written
    others = np.array([(1, 2.5), (3, 4.5)], [("a", "i2"), ("b", "f8")])
    vertex = PlyElement.describe(PlyData.read(path)["vertex"].data, "vertex")
    PlyData([PlyElement.describe(others, "other"), vertex], **kind).write(tmp_path / "later.ply")
    assert same(read_ply(tmp_path / "later.ply"), model)


@pytest.mark.parametrize("kind", [{"text": True}, {"byte_order": "<"}])
def test_no_vertices_have_their_properties_too(written, tmp_path, kind):
    _, path, _ = written
    none = PlyData.read(path)["vertex"].data[:0]
    PlyData([PlyElement.describe(none, "vertex")], **kind).write(tmp_path / "none.ply")
    assert read_vertices(tmp_path / "none.ply").dtype.names == none.dtype.names


def test_a_file_is_byte_for_byte_what_plyfile_writes(written, tmp_path):
    _, path, _ = written
    PlyData(PlyData.read(path).elements, byte_order="<").write(tmp_path / "again.ply")
    assert (tmp_path / "again.ply").read_bytes() == path.read_bytes()


def test_the_release_clamps_colours_at_zero(tmp_path):
    path = ply.write_ply(tmp_path / "m.ply", surfels("shading", material="paper"), "release")
    dark = write_vertices(path, columns_of(path, f_dc_1=np.full(7, -3.0)))
    assert not ply.read_ply(dark).parameters["colors"][:, 1].any()


def test_what_a_flavour_cannot_express(tmp_path):
    model = surfels("shading", shared=True)
    sharp, bad = {"shininess": torch.tensor([3.0])}, {"means": torch.full((7, 3), math.nan)}
    for given, changes, flavour, named in (
        (model, {}, "4dgs", "flavour: .*'4dgs'"),
        (model, sharp, "release", "shininess: "),
        (model, bad, "2dgs", "means: .*21 NaN"),
        (surfels("surfels"), {}, "release", "got stage surfels"),
    ):
        changed = replace(given, parameters={**given.parameters, **changes})
        refused(lambda m=changed, f=flavour: ply.write_ply(tmp_path / "m.ply", m, f), named)
    assert list(tmp_path.iterdir()) == []


def test_volumes_of_3dgs_are_no_surfels(tmp_path):
    path = ply.write_ply(tmp_path / "m.ply", surfels("surfels"), "3dgs")
    write_vertices(path, columns_of(path, scale_2=np.r_[np.full(4, -4.0), np.full(3, -13.0)]))
    refused(lambda: ply.read_ply(path), "got 4 of 7 with a third axis")


def test_a_point_cloud_of_the_papers_data_is_no_model():
    path = real_data("vortex/TF01/points3d.ply")
    refused(lambda: ply.read_ply(path), "number scale_0 each, got x, y, z, nx")
