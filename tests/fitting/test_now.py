"""A model of a function in seconds: where its surfels start, and what comes of them."""

from dataclasses import replace

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from tests.fitting.short_fits import shorten
from tests.refusals import refused
from tests.scene.test_twin import HIGH, LOOK, LOW
from texgs.core.camera import orbit
from texgs.core.lens import Lens
from texgs.core.light import HEADLIGHT
from texgs.fitting import now
from texgs.fitting.casting import ends_of_rays, thicken
from texgs.metrics.quality import psnr
from texgs.volume.caster import Caster
from texgs.volume.framing import frame_of
from texgs.volume.generate import sphere
from texgs.volume.grid import Grid
from texgs.volume.transfer import TransferFunction

LENS = Lens(3.0, 30.0, 64, 64)


@pytest.fixture
def small(monkeypatch):
    """Fits of seconds."""
    shorten(monkeypatch, frequency=2, surfels=1500, iterations=120)


@pytest.fixture(scope="module")
def grid():
    return sphere(32)


def of_range(tf, grid):
    return tf.scaled(float(grid.values.min()), float(grid.values.max()))


@pytest.mark.parametrize(("tf", "least"), [(HIGH, 30.0), (LOW, 27.0)])
def test_the_finer_model_is_closer_to_the_volume_in_a_view_between_others(small, grid, tf, least):
    tf, caster = of_range(tf, grid), Caster(grid, LOOK)
    first, finer = now.fit_now(caster, LOOK, tf, LENS, "sphere")
    assert first.stage == finer.stage == "texture"
    camera = orbit(17, 23, *LENS)
    truth = caster.cast(tf, camera, HEADLIGHT).rgba
    over_white = truth[..., :3] + 1 - truth[..., 3:]
    shown = (model.render(camera, HEADLIGHT, background=torch.ones(3)).color for model in (first, finer))
    quality = [psnr(color, over_white) for color in shown]
    assert least < quality[0] < quality[1] + 0.5  # so short a fit varies with how sums are rounded
    assert quality[1] > least


@pytest.mark.parametrize("height", [0.01, 0.1])
def test_surfels_start_where_views_see_something_also_behind_other_layers(small, grid, height):
    """Of a shell, as many start on its far side as that side adds to the picture."""
    shell = of_range(replace(LOW, opacity=((0.2, 0), (0.3, height), (0.4, 0))), grid)
    caster, camera = Caster(grid, LOOK), orbit(20, 10, *LENS)
    points = ends_of_rays(caster, LOOK, shell, [camera.resized(32)] * 60, 20_000, 0)
    assert len(points.places) > 1000
    depth = (points.places @ camera.viewmat[:3, :3].T + camera.viewmat[:3, 3])[:, 2]
    middle = torch.stack([torch.zeros(64, 64), torch.full((64, 64), LENS.radius)])
    whole = caster.cast(shell, camera, HEADLIGHT).rgba[..., 3].sum()
    front = caster.cast(shell, camera, HEADLIGHT, depth_range=middle).rgba[..., 3].sum()
    share = float((depth > LENS.radius).float().mean())
    assert share == pytest.approx(float(1 - front / whole), abs=0.04)
    assert 0.1 < share < 0.51


@given(st.floats(0, 0.999), st.floats(0.1, 50))
def test_thicker_matter_lets_a_power_of_the_light_through(alpha, factor):
    tf = TransferFunction(((0, alpha), (1, 0.5)), ((0, 1, 1, 1),))
    assert 1 - thicken(tf, factor).opacity[0][1] == pytest.approx((1 - alpha) ** factor, abs=1e-12)


def test_one_of_two_views_has_a_headlight_and_the_others_lights_of_their_own(small, grid, monkeypatch):
    """42 cameras, of which 14 have a headlight; of the others one of two is cast."""
    seen = []
    refine = now.fit_further
    watched = lambda model, images, *rest: seen.append(images) or refine(model, images, *rest)  # noqa: E731
    monkeypatch.setattr(now, "fit_further", watched)
    tf = of_range(HIGH, grid)
    assert len(list(now.fit_now(Caster(grid, LOOK), LOOK, tf, LENS, "sphere", soon=False))) == 1
    (images,) = seen
    assert (images.size, len(images)) == ((64, 64), 28)
    assert sum(light == HEADLIGHT for light in images.lights) == 14
    assert len(set(images.lights)) == 15


def test_a_function_that_shows_nothing_is_told(small, grid):
    nothing = TransferFunction(((1e6, 0), (2e6, 1)), ((0, 1, 1, 1),))
    refused(lambda: list(now.fit_now(Caster(grid, LOOK), LOOK, nothing, LENS, "nothing")), "got little")


def test_the_same_seed_gives_the_same_model(small, grid):
    tf, caster = of_range(HIGH, grid), Caster(grid, LOOK)
    one, other = (next(now.fit_now(caster, LOOK, tf, LENS, "sphere", seed=3)) for _ in range(2))
    assert all(torch.equal(x, other.parameters[name]) for name, x in one.parameters.items())


def test_a_speck_whose_camera_is_close_is_seen_by_its_model(small):
    """A frame around a ball of radius 0.03 is 0.13 away, nearer than the near plane of 2DGS."""
    places = torch.linspace(-0.5, 0.5, 101)
    square = sum(x.square() for x in torch.meshgrid(places, places, places, indexing="ij"))
    grid = Grid((-square / (2 * 0.012**2)).exp().numpy(), (1.0, 1.0, 1.0))
    tf = TransferFunction(((0.3, 0), (0.6, 0.9), (1, 0.9)), ((0, 1, 0.5, 0), (1, 1, 0.5, 0)))
    caster, lens = Caster(grid, LOOK), frame_of(grid, [tf]).lens(width=64, height=64)
    assert lens.radius < 0.2
    model = next(iter(now.fit_now(caster, LOOK, tf, lens, "speck")))
    camera = orbit(17, 23, *lens)
    truth = caster.cast(tf, camera, HEADLIGHT).rgba[..., 3]
    assert float(model.render(camera).alpha.mean()) > 0.8 * float(truth.mean()) > 0.05
