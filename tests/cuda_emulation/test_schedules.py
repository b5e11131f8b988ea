"""The CUDA kernels compute the same bits whatever the order of blocks, threads and streams."""

import pytest
import torch

from tests.cuda_emulation import emulated
from tests.raster import test_normals, test_shading, test_smoothness, test_ssim
from tests.raster.agreement import evaluate
from tests.raster.scenes import gaussians, random_scene, textured
from tests.raster.test_determinism import everything, voxels
from texgs.raster.losses import bilateral_smoothness, l1_dssim, normal_consistency
from texgs.raster.shading import blinn_phong_texture, spherical_harmonics

pytestmark = pytest.mark.emulated

SEEDS = range(4)


def losses():
    """Values and gradients of all losses and of shading, by name."""
    results = {"D-SSIM": evaluate(l1_dssim, *test_ssim.pair(33, 70, 3))}
    results["smoothness"] = evaluate(bilateral_smoothness, *test_smoothness.maps(33, 70, 2))
    depth, normal, *constants = test_normals.view(33, 70)
    value, gradients = test_normals.gradients(
        lambda n, z: normal_consistency(n, z, *constants), normal, depth
    )
    results["normals"] = (value, *gradients)
    leaves, camera = test_shading.surfels(700, test_shading.MATERIAL), test_shading.CAMERA
    results["shading"] = sum(map(tuple, test_shading.gradients(blinn_phong_texture, leaves, camera)), ())
    sh = [torch.linspace(-1, 1, 700 * 48).reshape(700, 16, 3), leaves[-2]]
    results["harmonics"] = sum(map(tuple, test_shading.gradients(spherical_harmonics, sh, camera)), ())
    return {f"{name} {i}": x for name, all_ in results.items() for i, x in enumerate(all_)}


COMPUTED = {
    "surfels": lambda: everything(random_scene(1, n=150)),
    "gaussians": lambda: everything(gaussians(random_scene(3, n=150))),
    "textured surfels": lambda: everything(textured(random_scene(2, n=150))),
    "losses": losses,
    "voxels": lambda: dict(enumerate(voxels(2, size=(16, 12, 16), n_rays=400))),
}


@pytest.mark.parametrize("name", COMPUTED)
def test_every_order_gives_the_same_bits(name):
    if reason := emulated.missing():
        pytest.skip(reason)
    expected = None
    for seed in SEEDS:
        with emulated.emulated_cuda(seed):
            values = COMPUTED[name]()
        expected = expected or values
        for quantity, value in values.items():
            assert torch.equal(value, expected[quantity]), (seed, quantity)
