"""3D Gaussians against gsplat's own 3DGS functions on small scenes.

gsplat caps alpha at 0.999, we at 0.99 as 3DGS does: opacities stay below. Its antialiased factor has no least
value.
"""

from dataclasses import replace

import pytest
import torch

from tests.raster import gsplat_torch
from tests.raster.agreement import decided, gradients, images, random_cotangents, relative
from tests.raster.scenes import gaussians, random_scene
from texgs.raster.api import rasterize
from texgs.raster.reference import render as reference
from texgs.raster.types import Options

OPTIONS = {
    "as 3DGS": Options(),
    "antialiased": Options(antialiased=True),
    "as gsplat": Options(near=0.01, dilation=0.5),
}
NAMES = ("color", "alpha", "depth")
GRADIENT_TOLERANCE = {"means": 5e-5, "quats": 5e-5, "scales": 5e-5, "opacities": 2e-5, "features": 2e-5}


def scene(seed, channels=3):
    """A random scene without opacities above both caps; every fifth Gaussian far off the view's axis."""
    made = gaussians(random_scene(seed, n=150, width=41, height=30, channels=channels))
    aside = 1.6 * made.viewmat[0, :3] * (torch.arange(150) % 5 == 0)[:, None]
    return replace(made, opacities=0.98 * made.opacities, means=made.means + aside)


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("options", OPTIONS.values(), ids=OPTIONS)
def test_definition(seed, options):
    ours = images(scene(seed).double().render(reference.rasterize, ("depth",), options))
    theirs = images(scene(seed).double().render(gsplat_torch.rasterize_gaussians, ("depth",), options))
    for name in NAMES:
        assert float((ours[name] - theirs[name]).abs().max()) < 1e-9, name


@pytest.mark.parametrize("channels", [3, 8])
@pytest.mark.parametrize("options", OPTIONS.values(), ids=OPTIONS)
def test_images(device, channels, options):
    made = scene(3, channels)
    theirs = images(made.double().render(gsplat_torch.rasterize_gaussians, ("depth",), options))
    ours = images(made.to(device).render(rasterize, ("depth",), options))
    sure = decided(made, options)
    for name in NAMES:
        assert float((ours[name].cpu() - theirs[name]).abs()[sure].max()) < 5e-5, name


@pytest.mark.parametrize("names", [("color",), ("alpha", "depth")], ids=",".join)
@pytest.mark.parametrize("options", OPTIONS.values(), ids=OPTIONS)
def test_gradients(device, names, options):
    made = scene(4)
    cotangents = random_cotangents(made, names, decided(made, options))
    theirs = gradients(gsplat_torch.rasterize_gaussians, made.double(), cotangents, options)
    ours = gradients(rasterize, made.to(device), cotangents, options)
    for name, gradient in theirs.items():
        if gradient.norm() > 1e-9:
            assert relative(ours[name], gradient) < GRADIENT_TOLERANCE[name], name
