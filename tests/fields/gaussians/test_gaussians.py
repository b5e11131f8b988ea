"""Gaussians as a field: views, files of texgs and of 3DGS, scenes of several."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from plyfile import PlyData
from safetensors.torch import load_file
from torch.testing import assert_close

from tests.fields.gaussians.samples import sample
from tests.fields.rewritten import description_of
from tests.fields.surfels.ply_files import numbered
from tests.fields.surfels.samples import same
from tests.fields.surfels.samples import sample as surfels
from tests.raster.agreement import images
from tests.raster.requirements import require_equal
from tests.refusals import refused
from texgs.core.camera import orbit
from texgs.fields.files import open_field
from texgs.fields.gaussians import Baked, Gaussians, JoinedGaussians, read_ply, write_gaussians, write_ply
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.ply import write_ply as write_surfels
from texgs.raster import Options
from texgs.raster.reference.render import rasterize

CAMERA = orbit(30, 20, 3, 40, 48, 40)


def directional(camera, means, sh):
    """Colours of harmonics of degree 0 and 1 as 3DGS has them, in float64."""
    away = torch.nn.functional.normalize(means.double() - camera.position.double(), dim=1)
    x, y, z = away[..., None].unbind(1)
    sh = sh.double()
    linear = -y * sh[:, 1] + z * sh[:, 2] - x * sh[:, 3]
    return (0.5 + 0.28209479177387814 * sh[:, 0] + 0.4886025119029199 * linear).clamp_min(0)


@pytest.mark.parametrize("antialiased", [False, True])
def test_a_view_is_that_of_the_float64_reference(antialiased):
    model = sample(30, degree=1, antialiased=antialiased)
    p = {name: x.double() for name, x in model.parameters.items()}
    expected = rasterize(
        p["means"],
        p["quats"],
        p["scales"].exp(),
        p["opacities"].sigmoid(),
        CAMERA.viewmat.double(),
        CAMERA.K.double(),
        CAMERA.width,
        CAMERA.height,
        features=directional(CAMERA, p["means"], p["sh"]),
        background=torch.ones(3).double(),
        outputs=("depth",),
        options=Options(antialiased=antialiased),
    )
    rendered = model.render(CAMERA, outputs=("depth",))
    # Rounding of float32; a fragment whose alpha is at the threshold of 1/255 may be in one of them only.
    assert_close(rendered.color.double(), expected.color, atol=5e-3, rtol=0)
    assert float((rendered.color - expected.color).abs().mean()) < 1e-5
    assert float((rendered.depth - expected.depth).abs().mean()) < 1e-3


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


OUTPUTS = ("depth", "median")


def test_a_scene_is_the_union_whatever_the_order():
    models = [sample(40, seed=1), sample(30, seed=2, degree=1), sample(20, seed=3, degree=0)]
    scene = JoinedGaussians(models)
    assert (len(scene), scene.palettes, str(scene.device)) == (90, [(0.0, 0.0, 0.0)] * 3, "cpu")
    turned = JoinedGaussians(models[::-1]).render(CAMERA)
    assert_close(scene.render(CAMERA).color, turned.color, atol=1e-6, rtol=0)
    apart = models[0].render(CAMERA).alpha
    assert bool((scene.render(CAMERA).alpha >= apart - 1e-3).all()), "nothing is lost"


def test_hiding_is_removing_bit_for_bit():
    models = [sample(40, seed=1), sample(30, seed=2), sample(20, seed=3)]
    edits = [PartEdit(), PartEdit(visible=False), PartEdit()]
    hidden = JoinedGaussians(models).render(CAMERA, edits=edits, outputs=OUTPUTS)
    removed = JoinedGaussians([models[0], models[2]]).render(CAMERA, outputs=OUTPUTS)
    require_equal(images(hidden), images(removed))


def test_an_opacity_is_a_factor_and_at_most_one():
    models = [sample(40, seed=1), sample(30, seed=2)]
    rendered = JoinedGaussians(models).render(CAMERA, edits=[PartEdit(opacity=0.4), PartEdit(opacity=1000.0)])
    p, q = (model.parameters for model in models)
    faint = Gaussians({**p, "opacities": torch.logit(0.4 * p["opacities"].sigmoid())})
    solid = Gaussians({**q, "opacities": torch.full((30,), 40.0)})
    assert_close(rendered.color, JoinedGaussians([faint, solid]).render(CAMERA).color, atol=2e-5, rtol=0)


def test_filters_that_differ_are_no_scene():
    refused(lambda: JoinedGaussians([sample(), sample(antialiased=True)]), "antialiased")
