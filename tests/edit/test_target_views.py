"""What a guidance sees, against the renderer of scenes and closed forms."""

from dataclasses import replace

import pytest
import torch
from torch.testing import assert_close

from tests.edit.textured import RADIUS, around, shell
from tests.fields.surfels.samples import sample
from texgs.core.errors import ArgumentError, ShapeError
from texgs.core.light import Light
from texgs.edit.target_views import render_views, require_texture
from texgs.fields.surfels.composition import Composition
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.texels import bare_colors, owners


def in_another_order(model):
    """The same model with its textures in reverse order, and a gap between any two."""
    p = model.parameters
    counts = p["sizes"].long().prod(1)
    offsets = ((counts + 2).flip(0).cumsum(0) - (counts + 2).flip(0)).flip(0)
    texels = torch.full((int((counts + 2).sum()), 3), 9.0)
    moved = Surfels({**p, "texels": texels, "offsets": offsets}, model.shading, model.metadata)
    texels[owners(moved.parameters)[0]] = p["texels"][owners(p)[0]]
    return moved


def test_bare_colours_are_those_of_a_scene_without_light():
    model, (camera, *_) = shell(), around()
    bare = render_views(model, bare_colors(model), [camera], None)
    scene = Composition([model]).render(camera, look="unshaded")
    assert_close(bare.images[0], scene.color.clamp(0, 1), atol=1e-5, rtol=0)
    assert_close(bare.alphas[0], scene.alpha)


@pytest.mark.parametrize("light", [Light("headlight"), Light("directional", 40, 30)])
def test_lit_views_are_those_of_a_scene(light):
    """Up to the clamping of highlights, of which this material has none that bright."""
    model, (camera, *_) = shell(), around()
    lit = render_views(model, bare_colors(model), [camera], light)
    scene = Composition([model]).render(camera, light)
    assert_close(lit.images[0], scene.color.clamp(0, 1), atol=1e-5, rtol=0)


def test_textures_may_lie_in_any_order():
    model, (camera, *_) = shell(), around()
    moved = in_another_order(model)
    one, other = (render_views(m, bare_colors(m), [camera], None).images for m in (model, moved))
    assert_close(one, other, atol=1e-6, rtol=0)


def test_points_lie_on_the_sphere_and_normals_point_from_it():
    model = shell(opacity=6.0)
    views = render_views(model, bare_colors(model), around(4), None)
    inside = views.alphas > 0.99
    points, normals = views.points[inside], views.normals[inside]
    assert int(inside.sum()) > 500
    assert_close(points.norm(dim=1).median(), torch.tensor(RADIUS), atol=0.03, rtol=0)
    cosine = (points * normals).sum(dim=1) / (points.norm(dim=1) * normals.norm(dim=1))
    assert cosine.median() > 0.95


def test_unprojected_pixels_are_projected_back():
    camera = around(3)[1]
    depth = torch.rand(camera.height, camera.width, generator=torch.Generator().manual_seed(0)) + 1
    points = camera.unproject(depth).reshape(-1, 3)
    local = points @ camera.viewmat[:3, :3].T + camera.viewmat[:3, 3]
    pixels = (local @ camera.K.T)[:, :2] / local[:, 2:]
    assert_close(local[:, 2], depth.flatten(), atol=1e-5, rtol=0)
    rows = torch.arange(camera.height).repeat_interleave(camera.width) + 0.5
    columns = torch.arange(camera.width).repeat(camera.height) + 0.5
    assert_close(pixels, torch.stack([columns, rows], dim=1), atol=1e-3, rtol=0)


def test_views_of_several_sizes_are_refused():
    model, cameras = shell(), around(2)
    other = replace(cameras[1], width=20)
    with pytest.raises(ArgumentError, match="all of one size"):
        render_views(model, bare_colors(model), [cameras[0], other], None)
    with pytest.raises(ArgumentError, match="at least one"):
        render_views(model, bare_colors(model), [], None)


def test_conditions_of_another_size_are_refused():
    model, cameras = shell(), around(2)
    with pytest.raises(ShapeError, match="conditions: expected"):
        render_views(model, bare_colors(model), cameras, None, torch.zeros(2, 5, 5, 3))


@pytest.mark.parametrize("stage", ["surfels", "shading"])
def test_models_without_texture_are_refused(stage):
    with pytest.raises(ArgumentError, match=f"expected stage texture, got {stage}"):
        require_texture(sample(stage))
