"""Clouds for other programs: what is visible of a scene, one colour a surfel, and the light on it."""

from dataclasses import replace

import numpy as np
import torch
from torch.testing import assert_close

from tests.fields.gaussians.samples import sample as gaussians
from tests.fields.surfels.samples import sample
from tests.fields.surfels.test_composition import CAMERA, SIDE, ball
from tests.refusals import refused
from tests.scene.balls import balls_in_a_volume
from tests.scene.cloud_files import drawn
from tests.scene.test_export import plain
from texgs.core.geometry import quats_to_matrices
from texgs.core.light import HEADLIGHT, Light
from texgs.fields.gaussians import write_gaussians
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.composition import Composition
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.model_file import write_model
from texgs.fields.surfels.shading import raw_material
from texgs.fields.surfels.texels import footprint, owners
from texgs.metrics.quality import psnr
from texgs.raster.shading import spherical_harmonics
from texgs.scene.clouds import cloud_of, clouds_of
from texgs.scene.exposure import exposure_of
from texgs.scene.scene import Scene, SceneModel, SceneSegment
from texgs.scene.segment_file import write_segment
from texgs.scene.twin import Twin

WHITE = [1.0, 1.0, 1.0]
MATT = raw_material(0.3, 0.6, 1e-6, 20.0, "bounded")


def matt(n=40):
    """Surfels without texture or highlight."""
    model = ball(4, n=n, stage="shading")
    return Surfels({**model.parameters, **MATT}, model.shading)


def test_a_headlight_is_its_projection_onto_harmonics():
    """|cos| is 1/2 + 5/8 P2(cos) and more of degree 4, P2 being Legendre's polynomial."""
    model = matt()
    cloud = cloud_of("a", (model, []), [PartEdit()], HEADLIGHT)
    assert cloud.sh.shape == (40, 9, 3)
    places = torch.randn(20, 3, generator=torch.Generator().manual_seed(0))
    for place in torch.nn.functional.normalize(places, dim=1):
        towards = place.expand(40, 3)
        cosine = (quats_to_matrices(model.parameters["quats"])[..., 2] * towards).sum(1)
        lit = 0.5 + 0.625 * (1.5 * cosine**2 - 0.5)
        seen = spherical_harmonics(torch.tensor(cloud.sh), -towards, torch.zeros(3))
        gain = (seen / model.parameters["colors"]).mean(1)
        assert_close(gain, 0.3 + 0.6 * lit, atol=0.02, rtol=0)  # of 92 directions in place of all


def test_edits_and_a_light_from_the_side_are_in_the_colors():
    models = [plain(1), plain(2)]
    edits = [PartEdit(palette=(0.9, 0.1, 0.4), opacity=0.6), PartEdit(specular=0.0, opacity=3.0)]
    pairs = zip("ab", models, edits, strict=True)
    clouds = [cloud_of(name, (model, []), [edit], SIDE) for name, model, edit in pairs]
    expected = Composition(models).render(CAMERA, SIDE, edits)
    unlit = Composition(models).render(CAMERA, edits=edits, look="unshaded")
    shown = drawn(clouds, CAMERA, WHITE)
    assert psnr(shown, expected.color) > 32 > 25 > psnr(unlit.color, expected.color)


def test_shadows_are_in_the_colors_as_frames_have_them(tmp_path):
    dark = Light("directional", SIDE.azimuth, SIDE.polar, 1.0, 1.0)
    scene = balls_in_a_volume(tmp_path, light=dark)
    lit, dim = ((clouds_of(replace(scene, light=light))) for light in (SIDE, dark))
    shares = exposure_of(scene.open(), scene, Twin(scene))
    assert float(shares.min()) < 0.9
    for one, other, (lamp, ambient) in zip(lit, dim, shares.T.split(150, dim=1), strict=True):
        alike = np.asarray((lamp > 0.99) & (ambient > 0.99))
        assert np.abs(one.sh - other.sh)[alike].max() < 0.02
        assert (other.sh[:, 0] <= one.sh[:, 0] + 1e-5).all()
    expected = scene.open().under(shares).render(CAMERA, dark).color
    bright = drawn(lit, CAMERA, WHITE)
    assert psnr(drawn(dim, CAMERA, WHITE), expected) > psnr(bright, expected) + 1
    baked = Scene({"C": SceneModel(write_gaussians(tmp_path / "c.safetensors", gaussians(30)))}, dark)
    refused(lambda: clouds_of(baked), "expected surfels for shadows and occlusion, got gaussians")


def test_the_color_is_that_of_the_mean_texel_under_the_gaussian():
    model = ball(1)
    everywhere_alike = raw_material(1 - 1e-6, 1e-6, 1e-6, 20.0, "bounded")
    p = dict(model.parameters) | everywhere_alike
    cloud = cloud_of("a", (Surfels(p, model.shading), []), [PartEdit()], HEADLIGHT)
    place, surfel = owners(p)
    weights = footprint(p["sizes"])
    for n in (0, 7, 149):
        own = surfel == n
        texel = (weights[own][:, None] * p["texels"][place[own]]).sum(0)
        expected = p["palette"] + p["colors"][n] + texel
        assert_close(0.5 + 0.28209479 * torch.tensor(cloud.sh[n, 0]), expected, atol=2e-3, rtol=0)
        assert np.abs(cloud.sh[n, 1:]).max() < 2e-3


def test_geometry_is_without_activations():
    model = gaussians(30)
    p = model.parameters
    cloud = cloud_of("a", (model, []), [PartEdit(opacity=0.5)], SIDE)
    assert not cloud.is_flat
    assert_close(torch.tensor(cloud.quats), p["quats"] / p["quats"].norm(dim=1, keepdim=True))
    assert_close(torch.tensor(cloud.scales), p["scales"].exp())
    assert_close(torch.tensor(cloud.opacities), 0.5 * p["opacities"].sigmoid())
    assert np.array_equal(cloud.sh, p["sh"])
    fitted = sample("surfels", n=9)
    flat = cloud_of("a", (fitted, []), [PartEdit()], HEADLIGHT)
    assert flat.is_flat
    assert_close(torch.tensor(flat.scales[:, :2]), fitted.parameters["scales"].exp())
    assert np.array_equal(flat.scales[:, 2], np.full(9, 1e-6, np.float32))
    assert np.array_equal(flat.sh, fitted.parameters["sh"]), "light is in it already"


def test_what_is_hidden_is_left_out(tmp_path):
    own = ball(1)
    file = write_model(tmp_path / "a.safetensors", own)
    mask = write_segment(tmp_path / "s.safetensors", own, torch.arange(150) < 50)
    hidden = PartEdit(visible=False)
    splats = write_gaussians(tmp_path / "b.safetensors", gaussians(30))
    part = SceneModel(file, segments={"part": SceneSegment(mask, hidden)})
    models = {"A": part, "B": SceneModel(file, hidden), "C": SceneModel(splats)}
    clouds = clouds_of(Scene(models))
    assert [(cloud.name, len(cloud.means)) for cloud in clouds] == [("A", 100), ("C", 30)]
    assert_close(torch.tensor(clouds[0].means), own.parameters["means"][50:])
    refused(
        lambda: clouds_of(Scene({"A": SceneModel(file, hidden), "C": SceneModel(splats, hidden)})),
        "at least one visible",
    )
    refused(
        lambda: clouds_of(Scene({"A": SceneModel(tmp_path / "none.safetensors")})),
        r"models\.A: .*no such file",
    )
