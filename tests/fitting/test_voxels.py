"""The fit of a voxel grid to a small ball, and each of its parts."""

from dataclasses import replace

import pytest
import torch

from tests.fitting.scenes import RADIUS, ball_images, ball_planes, blank_images, images_of, quality
from tests.real_data import real_data
from tests.refusals import refused
from texgs.config.compose import compose
from texgs.core.camera import orbit
from texgs.core.errors import FitError
from texgs.fields.voxels import Voxels
from texgs.fitting import checkpoint
from texgs.fitting.checkpoint import run_to_end
from texgs.fitting.hull import hull_box
from texgs.fitting.ray_settings import Decay, GridStage, VoxelKeys
from texgs.fitting.rays import MARGIN, curve, training_rays, widen
from texgs.fitting.voxels import VoxelFit, dilate, hull_grid, refine_grid, seen_voxels
from texgs.raster.voxel_grid import interpolate_rows
from texgs.raster.voxels import March, camera_rays
from texgs.volume.images import load
from texgs.volume.view_set import read_views

SETTINGS = VoxelKeys(
    stages=[GridStage(16, 40), GridStage(32, 80)],
    degree=1,
    half_size=0.6,
    rays=512,
    density=Decay(40.0, 2.0, 10),
)


@pytest.fixture(scope="module")
def images():
    return ball_images(count=8)


@pytest.fixture(scope="module")
def fit(images):
    voxel_fit = VoxelFit(images, SETTINGS)
    voxel_fit.progress = list(voxel_fit.run())
    return voxel_fit


def test_the_ball_is_found(fit, images):
    assert fit.progress == list(range(1, 121))
    assert fit.losses[0] < 0.01
    assert quality(Voxels(fit.grid, fit.march), images) > 25
    unseen = orbit(20, 10, 1.5, 50, 32, 32)
    assert quality(Voxels(fit.grid, fit.march), images_of([ball_planes(unseen)], [unseen])) > 20


def test_published_views():
    views = read_views(real_data("vortex/TF04_400"))
    keys = VoxelKeys(stages=[GridStage(32, 60), GridStage(64, 120)], rays=2048)
    fit = VoxelFit(load(views.train, reduce=4), keys)
    list(fit.run())
    assert quality(Voxels(fit.grid, fit.march), load(views.test[::30], reduce=4)) > 27


def test_what_is_outside_of_the_ball_stays_empty(fit):
    distance = fit.grid.points().norm(dim=1)
    far = distance > RADIUS + 4 * fit.grid.spacing
    assert fit.grid.density[1:][far].clamp_min(0).sum() < 0.05 * fit.grid.density[1:].clamp_min(0).sum()


@pytest.mark.parametrize("optimizer", ["rmsprop", "adam"])
def test_a_resumed_run_is_as_if_it_had_never_stopped(images, optimizer):
    settings = replace(SETTINGS, optimizer=optimizer, density=Decay(5.0, 1.0), occupy_every=15)
    whole, states = VoxelFit(images, settings), {}
    for done in whole.run():
        if done in (25, 40, 70):
            states[done] = {name: x.clone() for name, x in whole.state().items()}
    for stop, state in states.items():
        resumed = VoxelFit(images, settings, seed=1)
        resumed.restore(state)
        assert list(resumed.run()) == list(range(stop + 1, 121))
        assert torch.equal(resumed.grid.rows, whole.grid.rows)


@pytest.mark.parametrize("stages", [[GridStage(16, 3), GridStage(32, 0)], [GridStage(16, 3)]])
def test_a_run_that_stopped_after_its_last_step_ends_as_any_other(images, tmp_path, stages):
    settings = replace(SETTINGS, stages=stages)
    whole, stopped, resumed = (VoxelFit(images, settings) for _ in range(3))
    list(whole.run())
    for _ in zip(range(3), stopped.run(), strict=False):
        pass
    checkpoint.save(tmp_path, stopped)
    run_to_end(resumed, tmp_path, "resumed")
    for name in ("rows", "masks", "density", "occupied", "distance"):
        assert torch.equal(getattr(resumed.grid, name), getattr(whole.grid, name)), name


@pytest.mark.parametrize(("optimizer", "rate"), [("rmsprop", 40.0), ("adam", 5.0)])
def test_optimisers_without_total_variation(images, optimizer, rate):
    keys = {"stages": [GridStage(16, 80, total_variation=False)], "density": Decay(rate, 1.0, 10)}
    fit = VoxelFit(images, replace(SETTINGS, optimizer=optimizer, **keys))
    list(fit.run())
    assert quality(Voxels(fit.grid, fit.march), images) > 18


def test_training_rays_pass_through_their_pixels(images):
    rays = training_rays(images)
    ids = torch.arange(len(rays))
    all_rays, colors = rays.take(ids)
    start = int((rays.views == 0).sum())
    near = widen(images.planes[1, 3], MARGIN)
    inside = rays.views[start:] == 1
    assert int(inside.sum()) == int(near.sum())
    expected = torch.cat([camera_rays(images.cameras[1])[near], images.target(1).color[near]], dim=1)
    of_view = torch.cat([all_rays, colors], dim=1)[rays.views == 1]
    assert torch.equal(of_view[sorting(of_view)], expected[sorting(expected)])


def sorting(rays):
    """An order of rays [n, 9] by direction."""
    return (rays[:, 3:6] @ torch.tensor([1.0, 10.0, 100.0])).argsort()


def test_runs_are_neighbours(images):
    rays = training_rays(images)
    drawn, _ = rays.draw(64, 8, torch.Generator().manual_seed(0))
    again, _ = rays.draw(64, 8, torch.Generator().manual_seed(0))
    assert drawn.shape == (64, 6)
    assert torch.equal(drawn, again)
    places = {tuple(ray.tolist()): i for i, ray in enumerate(rays.take(torch.arange(len(rays)))[0])}
    for run in drawn.reshape(8, 8, 6):
        first = places[tuple(run[0].tolist())]
        assert [places[tuple(ray.tolist())] for ray in run] == list(range(first, first + 8))


def test_the_curve_visits_squares():
    order = curve(8, 8)
    assert torch.equal(order.sort().values, torch.arange(64))
    for size in (2, 4):
        for part in order.reshape(-1, size * size):
            assert int((part // 8).max() - (part // 8).min()) == size - 1
            assert int((part % 8).max() - (part % 8).min()) == size - 1
    assert sorted(curve(5, 3).tolist()) == list(range(15))


def test_the_hull_holds_the_ball(images):
    low, high = hull_box(images, 0.6)
    assert (low < -RADIUS).all()
    assert (high > RADIUS).all()
    grid = hull_grid(images, 16, 0.6, 1, 0.5)
    assert max(grid.size) in (16, 24)
    points = 0.95 * RADIUS * torch.nn.functional.normalize(torch.randn(200, 3), dim=1)
    assert (interpolate_rows(grid, points)[:, 3] > 0.45).all()
    assert len(grid) < torch.tensor(grid.size).prod()


def test_refining_keeps_the_field(fit):
    finer = refine_grid(fit.grid, torch.ones(fit.grid.size, dtype=torch.bool))
    assert finer.spacing == fit.grid.spacing / 2
    coarse, fine = (grid.rows[grid.links().long()] for grid in (fit.grid, finer))
    # float32 places, times densities of hundreds
    torch.testing.assert_close(fine[::2, ::2, ::2], coarse, rtol=1e-4, atol=1e-2)
    between = (coarse[:-1] + coarse[1:]) / 2
    torch.testing.assert_close(fine[1:-1:2, ::2, ::2], between, rtol=1e-4, atol=1e-2)


def test_a_grown_mask():
    mask = torch.rand(9, 10, 11, generator=torch.Generator().manual_seed(0)) < 0.02
    expected = torch.nn.functional.max_pool3d(mask[None].float(), 3, 1, 1)[0] > 0
    assert torch.equal(dilate(mask), expected)


def test_seen_voxels_are_near_the_surface(fit, images):
    rays = training_rays(images)
    seen = seen_voxels(fit.grid, rays, March(), 0.01, 1.0)
    some = seen_voxels(fit.grid, rays, March(), 0.01, 0.25)
    assert not (some & ~seen).any()
    assert 0 < int(seen.sum()) < len(fit.grid)
    distance = fit.grid.points().norm(dim=1)[fit.grid.links()[seen].long() - 1]
    assert distance.median() > 0.6 * RADIUS


def test_schedules():
    rate = Decay(100.0, 1.0, 10)
    assert rate.at(0, 100) == pytest.approx(1.0)
    assert rate.at(50, 100) == pytest.approx(10.0)
    assert rate.at(100, 100) == pytest.approx(1.0)
    # The published schedule: log-linear over 250,000 steps, with a ramp of 15,000.
    whole = compose(("fit=plenoxels",)).fit.voxels
    assert whole.steps == 128_000
    half = 125_000, whole.steps
    assert whole.density.at(*half) == pytest.approx(30 * (0.05 / 30) ** 0.5, rel=1e-3)
    assert whole.sh.at(*half) == pytest.approx(1e-2 * (5e-6 / 1e-2) ** 0.5, rel=1e-3)


def test_errors(images):
    uneven = replace(SETTINGS, stages=[GridStage(16, 1), GridStage(48, 1)])
    refused(lambda: hull_box(blank_images(), 0.6), "visual hull")
    refused(lambda: VoxelFit(blank_images(), SETTINGS), "something visible")
    refused(lambda: VoxelFit(images, uneven), r"stages: .*\[16, 48\]")
    refused(VoxelFit(images, replace(SETTINGS, prune_weight=1.0)).refine, "prune_weight", FitError)
    broken = VoxelFit(images, replace(SETTINGS, stages=[GridStage(16, 100)]))
    broken.grid.rows[1:, 0] = float("nan")
    refused(lambda: list(broken.run()), "iteration 100: .*NaN", FitError)
