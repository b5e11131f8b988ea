"""Images, gradients, statistics and adjoint are the same bits in every run and for any number of threads."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest
import torch

from benchmarks.scenes import camera, surfels
from tests.raster.agreement import gradients, images, names_of, random_cotangents
from tests.raster.requirements import require_equal, require_same_bits
from tests.raster.scenes import Scene, gaussians, random_scene, textured, textured_with_features
from tests.raster.voxel_scenes import voxel_scene
from texgs.raster import native
from texgs.raster.api import rasterize, splat
from texgs.raster.voxel_optimizer import VoxelOptimizer, VoxelRates, add_total_variation
from texgs.raster.voxels import March, Samples, ray_points, render_rays


def everything(scene):
    """All that the rasterizer computes for a scene, by name."""
    render = scene.render(rasterize, scene.outputs)
    results = images(render) | vars(render.statistics)
    image = torch.linspace(-1, 1, scene.height * scene.width * 2, device=scene.means.device)
    image = image.reshape(scene.height, scene.width, 2)
    results["sums"], results["weights"] = splat(image, **scene.geometry())
    cotangents = random_cotangents(scene, names_of(scene))
    return results | {f"gradient of {name}": x for name, x in gradients(rasterize, scene, cotangents).items()}


def generated(n=8000, size=200):
    """A scene of thousands of surfels and hundreds of tiles, so that threads meet."""
    view = camera(size)
    shift = torch.zeros(n, 2)
    return Scene(**surfels("transl", n), viewmat=view.viewmat, K=view.K, width=size, height=size, shift=shift)


SCENES = {
    "plain": generated,
    "32 channels": lambda: replace(generated(3000), features=torch.rand(3000, 32)),
    "textured": lambda: textured(generated(3000)),
    "textured, with features": lambda: textured_with_features(generated(3000), 5),
    "gaussians": lambda: gaussians(generated()),
    "gaussians, 32 channels": lambda: replace(gaussians(generated(3000)), features=torch.rand(3000, 32)),
    "small": random_scene,
}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name == "small" else pytest.mark.large) for name in SCENES]
)
def test_runs_and_threads(device, name):
    require_same_bits(everything, SCENES[name]().to(device))


def test_more_pairs_of_surfels_and_tiles_than_in_the_view_before(device, drawn):
    scene = drawn(random_scene(1, n=400, width=64, height=48)).to(device)
    native.release_memory(device.type)
    expected = everything(scene)
    native.release_memory(device.type)
    replace(scene, scales=0.05 * scene.scales).render(rasterize)
    require_equal(everything(scene), expected)


def test_other_work_in_between_changes_nothing(device):
    scene = random_scene().to(device)
    means = scene.means.clone().requires_grad_()
    first = scene.with_leaves({"means": means}).render(rasterize)
    for seed in range(1, 6):  # takes and returns the library's buffers
        random_scene(seed, n=500, width=90).to(device).render(rasterize)
    gradient = torch.autograd.grad(first.color.sum(), means)[0]
    again = scene.with_leaves({"means": means}).render(rasterize)
    assert torch.equal(gradient, torch.autograd.grad(again.color.sum(), means)[0])


def voxels(degree, size=(64, 40, 36), n_rays=20_000):
    """A rendering, its gradient, the largest weights, total variation and a step of the optimiser."""
    scene = voxel_scene(size=size, degree=degree, n_rays=n_rays)
    rows = scene.grid.rows.requires_grad_()
    rendered = render_rays(scene.grid, scene.rays, scene.march)
    gradient = torch.autograd.grad(rendered.color.square().sum() + rendered.alpha.sum(), rows)[0]
    weights = torch.zeros(len(rows))
    Samples(scene.grid, scene.march, scene.rays).mark(weights)
    rows.requires_grad_(False)
    optimizer = VoxelOptimizer(scene.grid, "adam")
    Samples(scene.grid, scene.march, scene.rays).add_gradient(rendered.color, None, optimizer.gradient)
    add_total_variation(scene.grid, torch.arange(20), 1.0, 1.0, optimizer.gradient)
    optimizer.step(VoxelRates(1.0, 0.1, 0.1))
    scene.grid.refresh_occupancy()
    return [*rendered, gradient, weights, rows.clone(), scene.grid.occupied, scene.grid.distance]


@pytest.mark.parametrize("degree", [0, 2])
def test_voxels(degree):
    require_same_bits(voxels, degree)
    scene = voxel_scene(degree=0, size=(64, 40, 36), n_rays=5000)
    require_same_bits(ray_points, scene.grid, scene.rays, March())
    native.release_memory()
    native.peak_memory(reset=True)
    assert native.peak_memory() == 0


def test_two_threads_may_go_back_through_one_graph():
    """They change what the library keeps of it: one after the other."""
    scene = random_scene(2, n=400, width=64, height=48)
    leaf = scene.means.clone().requires_grad_()
    render = replace(scene, means=leaf).render(rasterize, ("depth",))
    losses = render.color.sum(), render.depth.sum()
    expected = [torch.autograd.grad(loss, leaf, retain_graph=True)[0] for loss in losses]

    def same(number):
        runs = (torch.autograd.grad(losses[number], leaf, retain_graph=True)[0] for _ in range(20))
        return all(torch.equal(gradient, expected[number]) for gradient in runs)

    with ThreadPoolExecutor(2) as pool:
        assert all(pool.map(same, (0, 1)))
