"""Filters: fixed to the surface, in range, and of the look that their names promise."""

from dataclasses import replace
from itertools import pairwise

import pytest
import torch
from scipy.ndimage import find_objects, label
from torch.testing import assert_close

from tests.models.views_of import random_views
from texgs.core.camera import orbit
from texgs.models.filters import FILTERS, ProceduralFilters
from texgs.models.filters.painting import GOLD, tint
from texgs.models.filters.surface import (
    Surface,
    cell_hash,
    cell_keys,
    fractal_noise,
    neighbours,
    surface_of,
    tangential,
    value_noise,
)
from texgs.models.guidance import EditViews

GENERATOR = torch.Generator()


def plain_views(color=(0.6, 0.5, 0.2), **options):
    """Spheres of one colour."""
    views = random_views(**{"count": 2, "height": 96, "width": 96, **options})
    images = torch.tensor(color) * views.alphas[..., None] + 1 - views.alphas[..., None]
    return replace(views, images=images, conditions=images)


def plane(tone=0.5, side=160, cells=14.0, normal=(0.0, 0.0, 1.0)):
    """A flat square of one tone, and how to see it as an image."""
    at = (torch.arange(side) + 0.5) / side * cells
    y, x = torch.meshgrid(at, at, indexing="ij")
    points = torch.stack([x, y, torch.full_like(x, 0.37)], dim=-1).reshape(-1, 3)
    tones = torch.full((len(points),), tone)
    normals = torch.tensor(normal).expand_as(points)
    return Surface(torch.full_like(points, 0.6), tones, tones, points, normals, cells / side)


@pytest.mark.parametrize("name", [*FILTERS, "make it teal"])
def test_edits_are_images_over_white_and_change_what_is_seen(name):
    views = plain_views()
    edited, again = (ProceduralFilters()(views, name, torch.Generator().manual_seed(k)) for k in (0, 1))
    assert torch.equal(edited, again), "patterns do not depend on the call"
    assert edited.shape == views.images.shape
    assert 0 <= float(edited.min()) <= float(edited.max()) <= 1
    outside = views.alphas == 0
    assert (edited[outside] == 1).all()
    assert (edited - views.images)[~outside].abs().mean() > 0.02
    empty = replace(views, alphas=torch.zeros_like(views.alphas), images=torch.ones_like(views.images))
    assert (ProceduralFilters()(empty, name, GENERATOR) == 1).all(), "nothing to paint on"


@pytest.mark.parametrize("name", list(FILTERS))
def test_the_same_place_looks_the_same_in_another_view(name):
    """Pixels of two views that show the same points are painted alike, wherever they lie in the image."""
    views = plain_views()
    order = torch.randperm(96 * 96, generator=torch.Generator().manual_seed(0))

    def shuffled(x):
        return torch.stack([x[0], x[0].flatten(0, 1)[order].reshape(x[0].shape)])

    planes = (views.images, views.conditions, views.alphas, views.points, views.normals)
    pair = EditViews(*map(shuffled, planes), cameras=views.cameras)
    one, other = ProceduralFilters()(pair, name, GENERATOR)
    assert_close(one.flatten(0, 1)[order].reshape(other.shape), other, atol=1e-5, rtol=0)


@pytest.mark.parametrize("name", ["stipple drawing", "pencil hatching", "woodcut"])
def test_drawings_have_as_much_ink_as_it_is_dark(name):
    tones = [float(FILTERS[name](plane(tone)).mean()) for tone in (0.95, 0.65, 0.35, 0.05)]
    assert all(a > b + 0.03 for a, b in pairwise(tones))
    assert tones[0] > 0.8
    assert tones[-1] < 0.55


def test_dots_are_round_and_apart():
    image = FILTERS["stipple drawing"](plane(0.7))[:, 0].reshape(160, 160)
    places, count = label((image < 0.5).numpy())
    boxes = [[part.stop - part.start for part in box] for box in find_objects(places)]
    whole = [box for box in boxes if min(box) >= 4]
    assert count > 60
    assert sum(0.6 < h / w < 1.6 for h, w in whole) > 0.85 * len(whole)


def test_hatches_are_lines():
    """Along them the image changes far less than across."""
    image = FILTERS["pencil hatching"](plane(0.6))[:, 0].reshape(160, 160)
    change = [float((image - image.roll(shift, dims=(0, 1))).abs().mean()) for shift in ((5, 4), (-4, 5))]
    assert max(change) > 1.3 * min(change)


def test_gold_is_gold():
    """From dark to light its colours lie on the ramp of the metal, and warm throughout."""
    views = plain_views(color=(0.2, 0.4, 0.9))
    edited = ProceduralFilters()(views, "turn it into gold", GENERATOR)[views.alphas > 0]
    red, green, blue = edited.mean(dim=0)
    assert red > green > blue + 0.2
    assert edited.amin() >= min(GOLD[0]) - 1e-6
    assert float((edited[:, 0] - edited[:, 2]).min()) > 0.1


def test_tint_keeps_light_and_dark():
    surface = plane()
    surface = replace(surface, color=torch.linspace(0.2, 0.9, len(surface.tone))[:, None].expand(-1, 3))
    tinted = tint(surface, (0.1, 0.5, 0.5))
    assert (tinted[:, 1].diff() > -1e-6).all()
    middle = (surface.color[:, 0] - surface.color.mean()).abs().argmin()
    assert_close(tinted[middle], torch.tensor([0.1, 0.5, 0.5]), atol=0.01, rtol=0)


def test_tones_of_more_pixels_than_are_sorted_are_the_same(monkeypatch):
    views = plain_views(color=(0.2, 0.4, 0.9))
    tone = surface_of(views)[0].tone
    monkeypatch.setattr("texgs.models.filters.surface.MAX_SORTED_PIXELS", len(tone) // 8)
    assert_close(surface_of(views)[0].tone, tone, atol=0.01, rtol=0)


def test_straight_colours_of_half_transparent_views():
    views = plain_views(color=(0.3, 0.6, 0.9))
    half = views.alphas * 0.5
    images = torch.tensor([0.3, 0.6, 0.9]) * half[..., None] + 1 - half[..., None]
    surface, where = surface_of(replace(views, images=images, alphas=half))
    assert_close(surface.color, torch.tensor([0.3, 0.6, 0.9]).expand_as(surface.color), atol=1e-5, rtol=0)
    assert torch.equal(where, half > 0)


def test_pattern_size_is_that_of_the_scene_for_any_camera():
    far = plain_views(cameras=[orbit(50 * i, 0, 9.0, 10, 96, 96) for i in range(2)])
    near = plain_views()
    one, other = (surface_of(views)[0] for views in (far, near))
    size = [float((s.points.amax(0) - s.points.amin(0)).max()) for s in (one, other)]
    assert 18 < size[0] < 38
    assert size[0] == pytest.approx(size[1], rel=0.05)


@pytest.mark.parametrize("seed", [0, 7, 308])
def test_hash_is_that_of_unsigned_numbers_of_32_bits(seed):
    cells = [(0, 0, 0), (1, -2, 3), (-40, 25, 1000), (12345, -6789, -1)]
    expected = []
    for cell in cells:
        h = seed * 2654435761
        for place, prime in zip(cell, (73856093, 19349663, 83492791), strict=True):  # Teschner et al. 2003
            h ^= place * prime
        h %= 2**32
        h = (h ^ h >> 16) * 0x7FEB352D % 2**32
        h = (h ^ h >> 15) * 0x846CA68B % 2**32
        expected.append(((h ^ h >> 16) >> 8) / 2**24)
    assert cell_hash(cell_keys(torch.tensor(cells, dtype=torch.int32)), seed).tolist() == expected


def test_value_noise_is_the_hash_at_cells_and_trilinear_between():
    cells = torch.tensor([[0, 0, 0], [5, -3, 2], [-7, 4, 1]], dtype=torch.int32)
    assert_close(value_noise(cells.float(), 9), cell_hash(cell_keys(cells), 9))
    middle = value_noise(torch.tensor([[2.5, 1.0, -3.0]]), 9)
    ends = cell_hash(cell_keys(torch.tensor([[2, 1, -3], [3, 1, -3]], dtype=torch.int32)), 9)
    assert_close(middle[0], ends.mean())
    points = torch.linspace(-4, 4, 4001)[:, None] * torch.tensor([0.7, 0.5, -0.4])
    assert value_noise(points, 1).diff().abs().max() < 0.01  # continuous across cells
    assert 0 <= fractal_noise(points, 1).min() <= fractal_noise(points, 1).max() <= 1


def test_neighbours_hold_the_nearest_centre():
    points = torch.rand(200, 3, generator=torch.Generator().manual_seed(0)) * 3 - 1
    distances = torch.stack([vector.norm(dim=1) for vector, _ in neighbours(points, 5)])
    cells = torch.cartesian_prod(*[torch.arange(-4, 6, dtype=torch.int32)] * 3)
    shift = torch.stack([cell_hash(cell_keys(cells), 5 + 101 * axis) for axis in (1, 2, 3)], dim=1)
    centres = cells + 0.5 + 0.9 * (shift - 0.5)
    assert_close(distances.amin(dim=0), torch.cdist(points, centres).amin(dim=1), atol=1e-5, rtol=0)


def test_tangential_scales_what_is_along_the_normal():
    vector, normal = torch.tensor([[1.0, 2.0, 3.0]]), torch.tensor([[0.0, 0.0, 1.0]])
    assert_close(tangential(vector, normal, 0.25), torch.tensor([[1.0, 2.0, 0.75]]))
