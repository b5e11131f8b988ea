"""Steps of a series: surfels that move with matter, and what becomes of matter that appears or is gone."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from tests.fitting.short_fits import shorten
from tests.refusals import refused
from tests.scene.test_twin import LOOK
from tests.volume.test_motion import TF, blob
from texgs.core.camera import orbit
from texgs.core.geometry import quats_to_matrices
from texgs.core.light import HEADLIGHT
from texgs.fitting import casting, series
from texgs.fitting.casting import RayEnds
from texgs.fitting.now import fit_now
from texgs.fitting.series import Follower
from texgs.metrics import quality
from texgs.volume.caster import Caster
from texgs.volume.framing import frame_of
from texgs.volume.grid import Grid
from texgs.volume.motion import Motion

WAY, OTHER = (0.06, -0.04, 0.05), (0.25, 0.15, 0.2)


@pytest.fixture(scope="module")
def key():
    """A model of a ball, with texels, and its volume."""
    with pytest.MonkeyPatch.context() as patch:
        shorten(patch, frequency=2, surfels=1500, iterations=150)
        grid = blob((0, 0, 0))
        lens = frame_of(grid, [TF]).lens(width=64, height=64)
        *_, model = fit_now(Caster(grid, LOOK), LOOK, TF, lens, "ball")
    return model, grid


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Steps of a second."""
    monkeypatch.setattr(casting, "FREQUENCY", 2)
    for name, value in {"VIEW_SIZE": 48, "ROUNDS": 2}.items():
        monkeypatch.setattr(series, name, value)


def psnr(model, grid):
    camera = orbit(17, 23, 3.0, 30.0, 64, 64)
    seen = Caster(grid, LOOK).cast(TF, camera, HEADLIGHT).rgba
    return quality.psnr(model.render(camera).color, seen[..., :3] + 1 - seen[..., 3:])


def test_surfels_move_with_a_ball_and_all_else_stays(key):
    model, before = key
    after = blob(WAY)
    step = Follower(model, LOOK, TF).step(model, before, after, "ball", 1)
    assert psnr(step, after) > psnr(model, before) - 2.5
    assert psnr(step, after) > psnr(model, after) + 8
    for name in ("texels", "sizes", "offsets", "palette", "ambient", "shininess"):
        assert torch.equal(step.parameters[name], model.parameters[name])
    moved = step.parameters["means"] - model.parameters["means"]
    most = moved.sub(torch.tensor(WAY)).norm(dim=1).sort().values[: int(0.6 * len(moved))]
    assert float(most.max()) < 0.05  # most surfels are those of the same matter


def test_the_same_seed_gives_the_same_step(key):
    model, before = key
    one, other = (Follower(model, LOOK, TF).step(model, before, blob(WAY), "ball", 2) for _ in range(2))
    assert all(torch.equal(x, other.parameters[name]) for name, x in one.parameters.items())


def test_matter_that_appears_gets_surfels_and_matter_that_is_gone_has_none_to_be_seen(key):
    model, before = key
    after = Grid(np.maximum(before.values, blob(OTHER).values), before.spacing)
    step = Follower(model, LOOK, TF).step(model, before, after, "ball", 1)
    near = (step.parameters["means"] - torch.tensor(OTHER)).norm(dim=1) < 0.2
    assert int(near.sum()) > 100
    assert psnr(step, after) > psnr(model, after) + 1
    back = Follower(model, LOOK, TF).step(step, after, before, "ball", 2)
    assert psnr(back, before) > psnr(step, before)


def test_a_step_that_shows_nothing_hides_all_and_what_comes_back_is_seen_again(key):
    model, before = key
    nothing = blob((0, 0, 0), scale=0.1)
    gone = Follower(model, LOOK, TF).step(model, before, nothing, "ball")
    assert psnr(gone, nothing) > 60
    again = Follower(model, LOOK, TF).step(gone, nothing, before, "ball", 1)
    assert psnr(again, before) > psnr(gone, before) + 1


def test_axes_are_carried_as_matter_is_turned_and_stretched():
    """A motion that is linear carries surfels as its matrix does."""
    turn = torch.tensor([[0.0, -1.0, 0], [1, 0, 0], [0, 0, 1]]) @ torch.diag(torch.tensor([1.5, 0.8, 1.0]))
    axis = torch.linspace(-1, 1, 3)
    z, y, x = torch.meshgrid(axis, axis, axis, indexing="ij")
    places = torch.stack([x, y, z], dim=-1)
    moves = Motion(places @ turn.T - places, torch.full((3,), -1.0), torch.ones(3))
    p = {
        "means": torch.tensor([[0.2, -0.3, 0.1]]),
        "quats": torch.tensor([[1.0, 0, 0, 0]]),
        "scales": torch.tensor([[0.02, 0.03]]).log(),
        "normals": torch.tensor([[1.0, 0, 1, 0]]),  # along x
    }
    carried = series.carry(p, moves)
    torch.testing.assert_close(carried["means"], p["means"] @ turn.T)
    axes = quats_to_matrices(carried["quats"])[0]
    torch.testing.assert_close(axes[:, 0], torch.tensor([0.0, 1, 0]), atol=1e-5, rtol=0)
    torch.testing.assert_close(axes[:, 2], torch.tensor([0.0, 0, 1]), atol=1e-5, rtol=0)
    normal = quats_to_matrices(carried["normals"])[0, :, 2]
    torch.testing.assert_close(normal, torch.tensor([0.0, 1, 0]), atol=1e-5, rtol=0)
    torch.testing.assert_close(carried["scales"].exp(), torch.tensor([[0.03, 0.024]]), atol=1e-5, rtol=0)


def test_surfels_that_show_least_are_planted_where_none_are(key):
    model, _ = key
    flat = {**model.parameters, "colors": model.parameters["colors"] + series.mean_texture(model)}
    n = len(flat["means"])
    weights = torch.ones(n)
    weights[:7] = 0
    places = torch.cat([flat["means"][50:90], torch.full((300, 3), 0.4) + 0.01 * torch.rand(300, 3)])
    points = RayEnds(places, torch.tensor([[0.0, 0, 1]]).repeat(340, 1), torch.full((340, 3), 0.5))
    planted = series.plant(flat, points, weights, 0)
    changed = (planted["means"] != flat["means"]).any(dim=1)
    assert bool(changed[:7].all())
    assert int(changed.sum()) == int(series.PLANTED_SHARE * n)
    assert bool((planted["means"][changed] > 0.3).all())
    assert planted.keys() == flat.keys()


def test_other_lattices_and_models_without_shading_are_refused(key):
    model, before = key
    other = blob((0, 0, 0), sizes=(30, 30, 30))
    refused(lambda: Follower(model, LOOK, TF).step(model, before, other, "ball"), "resample")
    p = {name: x for name, x in model.parameters.items() if name in ("means", "quats", "scales", "opacities")}
    early = replace(model, parameters={**p, "sh": torch.zeros(len(model), 1, 3)})
    refused(lambda: Follower(early, LOOK, TF), "got surfels")


def test_matter_that_is_about_to_go_or_come_does_not_end_a_series(key):
    """Of a peak just within what the function shows, a view sees hardly a pixel."""
    model, before = key
    faint = blob((0, 0, 0), scale=0.203)
    follower = Follower(model, LOOK, TF)
    almost = follower.step(model, before, faint, "ball", 1)
    assert float(almost.render(orbit(17, 23, 3.0, 30.0, 64, 64)).alpha.mean()) < 0.02
    back = follower.step(almost, faint, before, "ball", 2)
    assert psnr(back, before) > psnr(almost, before) + 1


def test_spacings_that_differ_by_rounding_are_the_same(key):
    model, before = key
    after = blob(WAY)
    rounded = replace(after, spacing=tuple(step * (1 + 1e-9) for step in after.spacing))
    one, other = (Follower(model, LOOK, TF).step(model, before, each, "b", 3) for each in (after, rounded))
    torch.testing.assert_close(one.parameters["means"], other.parameters["means"], atol=1e-3, rtol=0)
