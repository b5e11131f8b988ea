import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from plyfile import PlyData
from safetensors.torch import load_file

from tests.fields.gaussians.samples import sample
from tests.fields.rewritten import description_of
from tests.fields.surfels.ply_files import numbered
from tests.fields.surfels.samples import same
from tests.fields.surfels.samples import sample as surfels
from texgs.fields.files import open_field
from texgs.fields.gaussians.files import read_ply, write_gaussians, write_ply
from texgs.fields.gaussians.model import Baked
from texgs.fields.surfels.ply import write_ply as write_surfels

NAMES = [
    *"xyz", "nx", "ny", "nz", *numbered("f_dc", 3), *numbered("f_rest", 45), "opacity",
    *numbered("scale", 3), *numbered("rot", 4),
]  # fmt: skip


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
@pytest.mark.parametrize("n", [0, 7])
def test_round_trip_is_exact(tmp_path, degree, n):
    model = sample(n, degree=degree, antialiased=degree == 2)
    field = open_field(write_gaussians(tmp_path / "new" / "model.safetensors", model))
    assert same(field, model)
    assert (field.kind, field.shading, field.metadata) == ("gaussians", model.shading, model.metadata)


def test_other_programs_can_read_the_tensors(tmp_path):
    path = write_gaussians(tmp_path / "m", sample(antialiased=True))
    assert torch.equal(load_file(path)["sh"], sample().parameters["sh"])
    description = description_of(path, "texgs-gaussians")
    assert description == {"version": 1, "filter": {"antialiased": True}, "metadata": sample().metadata}


@pytest.mark.parametrize("degree", [0, 3])
def test_the_layout_is_that_of_3dgs_with_248_bytes_each(tmp_path, degree):
    path = write_ply(tmp_path / "m.ply", sample(degree=degree))
    data = PlyData.read(path)
    assert (data.text, data.byte_order) == (False, "<")
    assert [p.name for p in data["vertex"].properties] == NAMES
    assert data["vertex"].data.dtype.itemsize == 248
    assert path.stat().st_size - 7 * 248 == path.read_bytes().index(b"end_header\n") + len(b"end_header\n")


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), n=st.integers(0, 5), antialiased=st.booleans())
def test_gaussians_come_back_exactly_but_for_the_filter(tmp_path_factory, seed, n, antialiased):
    model = sample(n, seed=seed, antialiased=antialiased)
    restored = open_field(write_ply(tmp_path_factory.mktemp("p") / "m.ply", model))
    assert same(restored, model)
    assert restored.shading == Baked()


def test_fewer_harmonics_come_back_with_zeros(tmp_path):
    model = sample(degree=1)
    harmonics = read_ply(write_ply(tmp_path / "m.ply", model)).parameters["sh"]
    assert torch.equal(harmonics[:, :4], model.parameters["sh"])
    assert not harmonics[:, 4:].any()


def test_surfels_written_for_viewers_of_gaussians_are_gaussians(tmp_path):
    model = surfels("surfels")
    restored = read_ply(write_surfels(tmp_path / "m.ply", model, "3dgs"))
    assert torch.equal(restored.parameters["scales"][:, :2], model.parameters["scales"])
    assert restored.parameters["scales"][:, 2].exp().max() < 1.1e-6
