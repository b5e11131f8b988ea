"""Scenes that rasterizers get wrong: the right images and gradients where defined, and finite numbers."""

from dataclasses import replace

import pytest
import torch

from tests.raster.agreement import (
    IMAGES,
    check_gradients,
    check_images,
    decided,
    gradients,
    images,
    names_of,
    random_cotangents,
    true_images,
)
from tests.raster.closed_form import view
from tests.raster.scenes import HARD_CASES, few, gaussians, textured
from texgs.core.camera import intrinsics, look_at
from texgs.raster import reference
from texgs.raster.api import rasterize
from texgs.raster.types import DEFAULT_OPTIONS, Options

# Needles are 10 000 times as long as wide: the intersection across them keeps a few digits in float32.
TOLERANCE = {"needles": 5e-3}
GRADIENT_TOLERANCE = {"needles": 2e-2}
# Seen exactly from the side a surfel faces neither way: the sign of its normal is a matter of rounding.
AMBIGUOUS = {"edge-on": {"normal"}}


def check(scene, device, name, options=DEFAULT_OPTIONS):
    """Compare all images of a scene that the definition is sure of."""
    compared = set(IMAGES) - AMBIGUOUS.get(name, set())
    check_images(scene, device, options, dict.fromkeys(compared, TOLERANCE.get(name, 1e-4)), -1)


@pytest.mark.parametrize("seed", [8498, 5278, 6557, 4261, 7550])
def test_large_surfels_that_reach_behind_the_camera(seed):
    """The near plane is so close against their extent that rounding may put what crosses it behind."""
    generator = torch.Generator().manual_seed(seed)
    extent = 10 ** (4 * torch.rand(1, generator=generator).item() + 1)
    means, quats = (torch.randn(1, n, generator=generator) for n in (3, 4))
    means, scales = extent * means, extent * 10 ** (torch.rand(1, 2, generator=generator) * 3 - 1.5)
    opacities = torch.rand(1, generator=generator).clamp_min(0.01)
    width, height = (int(torch.randint(1, 70, (1,), generator=generator)) for _ in range(2))
    position = torch.randn(3, generator=generator) * extent * torch.rand(1, generator=generator) * 2
    K = intrinsics(20 + 120 * torch.rand(1, generator=generator).item(), width, height)
    tensors = means, quats, scales, opacities, look_at(position, torch.zeros(3)), K
    seen = rasterize(*tensors, width, height, features=torch.ones(1, 1)).alpha
    exact = (x.double() for x in tensors)
    truth = reference.rasterize(*exact, width, height, features=torch.ones(1, 1).double()).alpha
    assert float(truth.mean()) > 0.02
    assert float(((seen - truth).abs() > 0.02).float().mean()) < 0.02


@pytest.mark.parametrize("z", [3.9, 3.971, 3.972, 3.9725, 3.973, 3.974, 3.975, 3.977, 3.979, 3.985, 4.2])
def test_a_surfel_that_ends_just_before_the_camera_is_whole(device, z):
    viewmat = torch.eye(4)
    viewmat[2, 3] = z
    tensors = {
        "means": torch.tensor([[-0.2, 0.4, 0]]),
        "quats": torch.tensor([[-0.53, 0.28, -0.075, 0.21]]),
        "scales": torch.tensor([[0.064, 1.5]]),  # in depth it ends 3.97 before its mean
        "opacities": torch.tensor([0.9]),
        "features": torch.ones(1, 1),
        "viewmat": viewmat,
        "K": torch.tensor([[60.0, 0, 32], [0, 60, 24], [0, 0, 1]]),
    }
    seen = rasterize(**{name: x.to(device) for name, x in tensors.items()}, width=64, height=48).alpha
    exact = {name: x.double() for name, x in tensors.items()}
    truth = reference.rasterize(**exact, width=64, height=48).alpha
    torch.testing.assert_close(seen.cpu().double(), truth, atol=0.01, rtol=0)


def single(given, device):
    """The same arguments in single precision on a device."""
    return {name: x.float().to(device) if isinstance(x, torch.Tensor) else x for name, x in given.items()}


@pytest.mark.parametrize("apart", [1e-1, 1e-2, 1e-3])
def test_distortion_of_layers_that_are_close(device, apart):
    given = view(means=[[0, 0, 3], [0, 0, 3 + apart]], scales=[[0.5, 0.5]] * 2, opacities=[0.5] * 2)
    given |= {"features": torch.ones(2, 1).double()}

    def rendered(rasterize, given):
        means = given["means"].detach().requires_grad_()
        distortion = rasterize(**given | {"means": means}, outputs=("distortion",)).distortion
        (gradient,) = torch.autograd.grad(distortion.sum(), means)
        return distortion.detach().cpu().double(), gradient[:, 2].cpu().double()

    ours, exact = rendered(rasterize, single(given, device)), rendered(reference.rasterize, given)
    for one, other in zip(ours, exact, strict=True):
        torch.testing.assert_close(one, other, rtol=3e-6 / apart, atol=0)  # depths are rounded to 2e-7


def check_learning(scene, device, name, compared, options=DEFAULT_OPTIONS):
    """Compare the gradients of random combinations of some images."""
    tolerance = dict.fromkeys(scene.leaves(), GRADIENT_TOLERANCE.get(name, 1e-3))
    check_gradients(scene, device, sorted(compared), options, tolerance=tolerance, least=1e-6)


@pytest.mark.parametrize("name", HARD_CASES)
def test_images(device, drawn, name):
    check(drawn(HARD_CASES[name]()), device, name)


@pytest.mark.parametrize("name", HARD_CASES)
def test_gradients(device, drawn, name):
    scene = drawn(HARD_CASES[name]())
    scene = replace(scene, shift=torch.zeros(len(scene.means), 2))
    check_learning(scene, device, name, set(names_of(scene)) - {"distortion"} - AMBIGUOUS.get(name, set()))


@pytest.mark.parametrize("name", HARD_CASES)
def test_textured(device, name):
    scene = HARD_CASES[name]()
    scene = textured(scene, sizes=[(4, 4), (1, 1), (33, 7), (1, 200), (60, 50)])
    rendered = images(scene.to(device).render(rasterize))
    expected = true_images(scene)
    error = (rendered["color"].cpu() - expected["color"]).abs()[decided(scene)]
    assert rendered["color"].isfinite().all()
    share = 0.98 if name == "edge-on" else 0.999  # along an edge texture coordinates run through all values
    assert (error < TOLERANCE.get(name, 1e-3)).double().mean() > share or not error.numel()
    for gradient in gradients(rasterize, scene.to(device), random_cotangents(scene, ("color",))).values():
        assert gradient.isfinite().all()


@pytest.mark.parametrize("name", ["crossing the camera plane", "edge-on", "smaller than a pixel", "needles"])
@pytest.mark.parametrize(
    "options", [Options(low_pass=1e30), Options(low_pass=64, filter_sigma=3)], ids=["off", "64"]
)
def test_other_filters(device, name, options):
    check(HARD_CASES[name](), device, name, options)


@pytest.mark.parametrize(
    "name", ["far off the image", "smaller than a pixel", "larger than the image", "needles"]
)
def test_antialiased(device, name):
    scene, options = gaussians(HARD_CASES[name]()), Options(antialiased=True)
    check(scene, device, name, options)
    check_learning(scene, device, name, ("color", "depth"), options)


def test_every_surfel_at_one_pixel(device, drawn):
    scene = drawn(few(n=3000, width=20, height=20))
    scene = replace(scene, means=1e-3 * scene.means, opacities=0.01 * scene.opacities)
    rendered = images(scene.to(device).render(rasterize, scene.outputs))
    expected = true_images(scene, scene.outputs)
    error = (rendered["color"].cpu() - expected["color"]).abs()
    assert float(error.median()) < 1e-4  # depths differ by less than float32 resolves, so a few change places
    assert float(error.max()) < 0.05
