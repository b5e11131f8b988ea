"""The CUDA kernels compute the same bits whatever the order of blocks, threads and streams."""

import pytest
import torch

from tests.cuda_emulation import emulated
from tests.raster.operations import OPERATIONS, of_operation
from tests.raster.scenes import gaussians, random_scene, textured
from tests.raster.test_determinism import everything, voxels
from tests.volume import test_light_devices as light

pytestmark = pytest.mark.emulated

SEEDS = range(4)
SIZES = {"pair": (33, 70, 3), "maps": (33, 70, 2), "bumps": (33, 70), "bumps_with_normals": (33, 70)}


def operations():
    """Return values and gradients of all losses and of shading, by name."""
    results = {}
    for name, operation in OPERATIONS.items():
        size = SIZES.get(getattr(operation.inputs, "__name__", ""), (700, *operation.large[1:]))
        results |= {f"{name} {i}": x for i, x in enumerate(of_operation(operation, size))}
    return results


COMPUTED = {
    "surfels": lambda: everything(random_scene(1, n=150)),
    "gaussians": lambda: everything(gaussians(random_scene(3, n=150))),
    "textured surfels": lambda: everything(textured(random_scene(2, n=150))),
    "operations": operations,
    "light": lambda: light.everything("float32"),
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
