"""Palette fields whose networks say 0: boxes of density 1 and one colour, which have closed forms."""

from math import exp, log

import pytest
import torch

from tests.refusals import refused
from texgs.core.camera import orbit
from texgs.core.errors import DeviceError
from texgs.fields.palette.model import PaletteField, PaletteScene
from texgs.fields.palette.networks import new_networks
from texgs.fields.palette.rendering import Geometry, blending_weights
from texgs.fields.part_edit import PartEdit
from texgs.fitting.colors import cluster_colors
from texgs.raster.hash_encoding import HashLevels
from texgs.raster.voxel_grid import pack_rows, voxel_grid
from texgs.raster.voxels import March

CAMERA = orbit(0, 0, 4.0, 30.0, 49, 41)
LEVELS = HashLevels(levels=3, entries=256, coarsest=4, finest=16)
COLORS = ((0.9, 0.3, 0.1), (0.1, 0.5, 0.7))
SIDE, SPACING = 16, 0.05


def box(center=(0.0, 0.0, 0.0), colors=COLORS, scale=0.0, seed=0, free=False):
    """A cube full of voxels; tables and layers are random times `scale`, and 0 by default."""
    lower = [c - 0.5 * SPACING * (SIDE - 1) for c in center]
    grid = voxel_grid(torch.ones(SIDE, SIDE, SIDE, dtype=torch.bool), lower, SPACING, 0)
    rows = pack_rows(torch.full((len(grid),), 0.01), torch.zeros(len(grid), 1, 3))
    geometry = Geometry(grid.with_rows(torch.cat([grid.rows[:1], rows])), March(step=0.5), LEVELS)
    names = ["density", "trunk", "palette", "mixture", "light"] + ["free"] * free
    networks = new_networks(names, LEVELS, len(colors), torch.Generator().manual_seed(seed))
    networks = {name: (100 if "table" in name else 1) * scale * x for name, x in networks.items()}
    return PaletteField(geometry, {**networks, "palette.colors": torch.tensor(colors)}, {"tf": "TF01"})


def middle(image):
    """The pixel whose ray passes through the centre of the cube along an axis."""
    return image[20, 24]


def test_a_box_has_the_alpha_and_colour_of_its_closed_form():
    shown = box().render(CAMERA, outputs=("depth",))
    length = SPACING * (SIDE - 1)
    alpha = 1 - exp(-length)
    color = log(2) * torch.tensor(COLORS).mean(0)
    assert middle(shown.alpha).item() == pytest.approx(alpha, rel=1e-5)
    torch.testing.assert_close(middle(shown.color), alpha * color + 1 - alpha)
    start = 4.0 - length / 2  # of the box; the mean of an exponential distribution cut at its end
    depth = start + 1 - length * (1 - alpha) / alpha
    assert middle(shown.depth).item() == pytest.approx(depth, abs=0.25 * SPACING)
    assert float(shown.alpha[0, 0]) == 0
    assert torch.equal(shown.color[0, 0], torch.ones(3))


def test_density_doubles_where_boxes_overlap():
    scene = PaletteScene([box(), box(colors=((0.0, 0.0, 0.2),))])
    shown, length = scene.render(CAMERA), SPACING * (SIDE - 1)
    alpha = 1 - exp(-2 * length)
    color = log(2) * (torch.tensor(COLORS).mean(0) + torch.tensor([0.0, 0.0, 0.2])) / 2
    assert middle(shown.alpha).item() == pytest.approx(alpha, rel=1e-5)
    # Points of both lie at the same places: one is a step in front of the other.
    torch.testing.assert_close(middle(shown.color), alpha * color + 1 - alpha, atol=0.01, rtol=0)
    assert scene.palettes == [(0.0, 0.0, 0.0)] * 2
    assert len(scene) == 2 * len(box()) == 4 * LEVELS.rows


def test_boxes_apart_are_seen_as_each_alone():
    left, right = box((0.0, 0.0, -0.5), scale=1.0), box((0.0, 0.0, 0.5), scale=1.0, seed=1)
    together = PaletteScene([left, right]).render(CAMERA).color
    first, second = (field.render(CAMERA) for field in (left, right))
    clear = (first.alpha > 0) != (second.alpha > 0)
    assert bool(clear.any())
    torch.testing.assert_close(together[clear], (first.color + second.color - 1)[clear], atol=1e-6, rtol=0)


def test_edits_of_opacity_and_visibility():
    scene, length = PaletteScene([box(), box((0.0, 0.0, 0.5))]), SPACING * (SIDE - 1)
    thin = scene.render(CAMERA, edits=[PartEdit(opacity=3.0), PartEdit(visible=False)])
    assert middle(thin.alpha).item() == pytest.approx(1 - exp(-3 * length), rel=1e-5)
    none = scene.render(CAMERA, edits=[PartEdit(visible=False)] * 2, background=torch.tensor([0.1, 0.2, 0.3]))
    assert torch.equal(middle(none.color), torch.tensor([0.1, 0.2, 0.3]))


def test_blending_weights_are_those_of_a_plain_loop():
    generator = torch.Generator().manual_seed(0)
    ray = torch.randint(30, (400,), generator=generator).sort().values
    depth = (20 * torch.rand(400, generator=generator) ** 6).double().requires_grad_()
    expected, left = [], {}
    for d, r in zip(depth, ray.tolist(), strict=True):
        expected.append(left.get(r, 1.0) * (1 - torch.exp(-d)))
        left[r] = left.get(r, 1.0) * torch.exp(-d)
    weights, expected = blending_weights(depth, ray), torch.stack(expected)
    torch.testing.assert_close(weights.double(), expected, atol=1e-7, rtol=1e-6)
    values = torch.randn(400, generator=generator).double()
    gradients = [torch.autograd.grad((x.double() * values).sum(), depth)[0] for x in (weights, expected)]
    torch.testing.assert_close(*gradients, atol=1e-6, rtol=1e-5)
    assert len(blending_weights(depth[:0], ray[:0])) == 0


def test_clusters_are_of_hues_and_the_largest_comes_first():
    generator = torch.Generator().manual_seed(0)
    light = 0.3 + 0.7 * torch.rand(900, 1, generator=generator)
    hues = torch.tensor([[1.0, 0.2, 0.1], [0.1, 0.3, 1.0]])
    colors = light * hues[(torch.arange(900) % 3 == 0).long()]
    clusters = cluster_colors(colors, 2)
    torch.testing.assert_close(clusters / clusters.amax(1, keepdim=True), hues, atol=0.01, rtol=0)
    one = cluster_colors(torch.tensor([[0.5, 0.5, 0.5], [0.4, 0.4, 0.2]]), 3)
    torch.testing.assert_close(one.sort(0).values[2], torch.tensor([0.5, 0.5, 0.5]))
    assert one.shape == (3, 3)
    torch.testing.assert_close(cluster_colors(torch.full((9, 3), 0.5), 2), torch.full((2, 3), 0.5))


def test_palette_fields_are_on_the_cpu():
    refused(lambda: box().to("cuda"), "cpu, got cuda", DeviceError)
