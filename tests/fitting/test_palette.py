"""The fit of a palette field to a small ball, and each of its parts."""

from dataclasses import replace

import pytest
import torch

from tests.fitting.scenes import ball_images, ball_planes, blank_images, images_of, quality
from tests.raster.requirements import require_equal
from tests.refusals import refused
from texgs.core.camera import orbit
from texgs.core.errors import FitError
from texgs.fields.palette.networks import base_color, density, palette_color
from texgs.fields.palette.rendering import points_on, view_harmonics
from texgs.fitting import checkpoint
from texgs.fitting.checkpoint import run_to_end
from texgs.fitting.colors import object_palette
from texgs.fitting.palette import PaletteFit, base_loss
from texgs.fitting.ray_settings import Decay, GridStage, HashKeys, PaletteKeys, VoxelKeys

VOXELS = VoxelKeys(
    stages=[GridStage(16, 30), GridStage(32, 30)],
    degree=0,
    half_size=0.6,
    rays=512,
    density=Decay(40.0, 2.0, 10),
)
SETTINGS = PaletteKeys(
    voxels=VOXELS,
    hash=HashKeys(levels=4, entries=1024, coarsest=4, finest=32),
    seed_steps=20,
    base_steps=60,
    palette_steps=40,
    rays=512,
)
STEPS = 180
STOPS = (20, 70, 140, STEPS)  # within the grid's fit and each part of that of networks, and between them


@pytest.fixture(scope="module")
def images():
    return ball_images(count=8)


@pytest.fixture(scope="module")
def checkpoints(tmp_path_factory):
    """The folder of the checkpoints of the fit, by iteration."""
    return tmp_path_factory.mktemp("checkpoints")


@pytest.fixture(scope="module")
def fit(images, checkpoints):
    """A fit with its progress, and the density networks before palette colours learned."""
    palette_fit = PaletteFit(images, SETTINGS)
    palette_fit.progress = []
    for done in palette_fit.run():
        palette_fit.progress.append(done)
        if done in STOPS:
            checkpoint.save(checkpoints / str(done), palette_fit)
        if done == STEPS - 40:
            palette_fit.before = {name: x.detach().clone() for name, x in palette_fit.parameters.items()}
    return palette_fit


def test_the_ball_is_found(fit, images):
    assert fit.progress == list(range(1, STEPS + 1))
    field = fit.field({})
    assert quality(field, images) > 25
    unseen = orbit(20, 10, 1.5, 50, 32, 32)
    assert quality(field, images_of([ball_planes(unseen)], [unseen])) > 20
    assert not any(name.startswith("base") for name in field.parameters)
    assert fit.losses[-1] < 0.01


def test_palette_colours_learn_on_frozen_geometry(fit):
    for name, x in fit.before.items():
        if name.startswith(("density", "base")):
            assert torch.equal(x, fit.parameters[name]), name
    assert not torch.equal(fit.before["trunk.0"], fit.parameters["trunk.0"])


def test_the_palette_has_the_hue_of_the_ball(images):
    (color,) = object_palette(images, 1, 0)
    torch.testing.assert_close(color / color[0], torch.tensor([1.0, 0.5, 0.25]), atol=0.02, rtol=0)


@pytest.mark.parametrize("stop", STOPS)
def test_a_resumed_run_is_as_if_it_had_never_stopped(fit, images, checkpoints, stop):
    resumed = PaletteFit(images, SETTINGS, seed=1)
    resumed.colors = fit.colors
    run_to_end(resumed, checkpoints / str(stop), "resumed")
    assert resumed.iteration == resumed.iterations == STEPS
    require_equal(resumed.parameters, fit.parameters)
    assert torch.equal(resumed.geometry.grid.rows, fit.geometry.grid.rows)


def test_the_loss_of_the_base_has_the_gradient_of_a_plain_graph(fit, images):
    """With every point in one graph; nothing is left out where all weights count."""
    parameters = {name: x.detach().requires_grad_() for name, x in fit.parameters.items()}
    rays, target = fit.rays.draw(64, 2, torch.Generator().manual_seed(0))
    loss = base_loss(rays, target, fit.geometry, parameters, -1.0)
    names = ["density.table", "density.0", "trunk.0", "base.0"]
    gradients = torch.autograd.grad(loss, [parameters[name] for name in names])
    with torch.no_grad():
        points = points_on(rays, fit.geometry, parameters)
    sigma, features = density(points.at, parameters, fit.levels)
    color = base_color(features, view_harmonics(rays)[points.ray], parameters)
    total = 0.0
    for ray in range(64):
        light, blended = 1.0, 0.0
        for i in (points.ray == ray).nonzero()[:, 0]:
            alpha = 1 - torch.exp(-fit.geometry.length * sigma[i])
            blended = blended + light * alpha * color[i]
            light = light * (1 - alpha)
        total = total + (blended + light - target[ray]).square().sum()
    torch.testing.assert_close(loss, total / (3 * 64), rtol=1e-4, atol=1e-8)
    expected = torch.autograd.grad(total / (3 * 64), [parameters[name] for name in names])
    for one, other in zip(gradients, expected, strict=True):
        torch.testing.assert_close(one, other, rtol=1e-3, atol=1e-6)


def test_shares_of_palette_colours_add_up_to_one():
    settings = replace(SETTINGS, colors=3, seed_steps=0, base_steps=5, palette_steps=5)
    fit = PaletteFit(ball_images(count=4), settings)
    list(fit.run())
    mixed = palette_color(torch.rand(50, 3), fit.parameters, fit.levels)
    torch.testing.assert_close(mixed.shares.sum(1), torch.ones(50))
    assert mixed.shares.shape == (50, 3)
    assert bool((mixed.shares > 0.01).all())


def test_errors(images):
    voxels, one = replace(VOXELS, stages=[]), replace(VOXELS, stages=[GridStage(16, 5)])
    for keys, named in (
        ({"voxels": voxels}, "voxels.stages"),
        ({"hash": HashKeys(entries=1000)}, "hash.entries"),
        ({"hash": HashKeys(coarsest=600)}, "hash.finest"),
    ):
        refused(lambda keys=keys: PaletteFit(images, replace(SETTINGS, **keys)), f"fit.palette.{named}")
    refused(lambda: PaletteFit(blank_images(), SETTINGS), "something visible")
    unseen = PaletteFit(images, replace(SETTINGS, voxels=one))
    unseen.voxels.settings = replace(unseen.voxels.settings, prune_weight=1.0)
    refused(lambda: list(unseen.run()), "prune_w", FitError)
    broken = PaletteFit(images, replace(SETTINGS, voxels=one, base_steps=5, palette_steps=5, rate=1e6))
    refused(lambda: list(broken.run()), "iteration 35: .*finite", FitError)
