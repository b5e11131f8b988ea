"""A model of a function in seconds: where its surfels start, and what comes of them."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from tests.scene.test_twin import HIGH, LOOK, LOW
from texgs.core.camera import orbit
from texgs.core.errors import ArgumentError
from texgs.core.lens import Lens
from texgs.core.light import HEADLIGHT
from texgs.fitting import now
from texgs.volume.caster import Caster
from texgs.volume.generate import sphere
from texgs.volume.transfer import TransferFunction

LENS = Lens(3.0, 30.0, 64, 64)


@pytest.fixture
def small(monkeypatch):
    """Fits of seconds."""
    for name, value in {"FREQUENCY": 2, "SURFELS": 1500, "PASSES": (120, 120)}.items():
        monkeypatch.setattr(now, name, value)


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
    errors = [
        (
            model.render(camera, HEADLIGHT, background=torch.ones(3)).color
            - truth[..., :3]
            - 1
            + truth[..., 3:]
        )
        for model in (first, finer)
    ]
    quality = [-10 * float(error.square().mean().log10()) for error in errors]
    assert least < quality[0] < quality[1] + 0.3
    assert quality[1] > least


@pytest.mark.parametrize("height", [0.01, 0.1])
def test_surfels_start_where_views_see_something_also_behind_other_layers(small, grid, height):
    """Of a shell, as many start on its far side as that side adds to the picture."""
    shell = of_range(replace(LOW, opacity=((0.2, 0), (0.3, height), (0.4, 0))), grid)
    caster, camera = Caster(grid, LOOK), orbit(20, 10, *LENS)
    points = now.ends_of_rays(caster, LOOK, shell, SimpleNamespace(cameras=[camera] * 60), 0)
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
    assert 1 - now.thickened(tf, factor).opacity[0][1] == pytest.approx((1 - alpha) ** factor, abs=1e-12)


def test_a_function_that_shows_nothing_is_told(small, grid):
    nothing = TransferFunction(((1e6, 0), (2e6, 1)), ((0, 1, 1, 1),))
    with pytest.raises(ArgumentError, match="expected to see something of the volume, got nothing; raise"):
        list(now.fit_now(Caster(grid, LOOK), LOOK, nothing, LENS, "nothing"))


def test_the_same_seed_gives_the_same_model(small, grid):
    tf, caster = of_range(HIGH, grid), Caster(grid, LOOK)
    one, other = (next(now.fit_now(caster, LOOK, tf, LENS, "sphere", seed=3)) for _ in range(2))
    assert all(torch.equal(x, other.parameters[name]) for name, x in one.parameters.items())
