"""The rasterizer against gsplat's own 2DGS functions on small scenes, with gsplat's options.

gsplat caps alpha at 0.999 there, we at 0.99: opacities stay below. It has no near plane for fragments and no
depth but that of the mean: neither is compared.
"""

from dataclasses import replace

import pytest

from tests.raster import gsplat_torch
from tests.raster.agreement import decided, gradients, images, random_cotangents, relative
from tests.raster.scenes import random_scene
from texgs.raster.api import rasterize
from texgs.raster.reference import render as reference
from texgs.raster.types import Options

LIKE_GSPLAT = Options(low_pass=2.0, filter_sigma=1.0, near=0.01, far=1e10)
GRADIENT_TOLERANCE = {"means": 5e-4, "quats": 1e-3, "scales": 2e-4, "opacities": 1e-4, "features": 5e-5}


def scene(seed, channels=3):
    """A random scene without opacities above gsplat's and our cap."""
    made = random_scene(seed, n=150, width=41, height=30, channels=channels)
    return replace(made, opacities=0.98 * made.opacities)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_definition(seed):
    ours = images(scene(seed).double().render(reference.rasterize, ("normal",), LIKE_GSPLAT))
    theirs = images(scene(seed).double().render(gsplat_torch.rasterize, ("normal",), LIKE_GSPLAT))
    for name, tolerance in (("color", 1e-9), ("alpha", 1e-9), ("normal", 1e-6)):
        # gsplat's normals are in camera axes, and a rotation rounded to float32 is not quite orthogonal
        assert float((ours[name] - theirs[name]).abs().max()) < tolerance, name


@pytest.mark.parametrize("channels", [3, 8])
def test_images(device, channels):
    made = scene(3, channels)
    theirs = images(made.double().render(gsplat_torch.rasterize, ("normal",), LIKE_GSPLAT))
    ours = images(made.to(device).render(rasterize, ("normal",), LIKE_GSPLAT))
    sure = decided(made, LIKE_GSPLAT)
    for name in ("color", "alpha", "normal"):
        assert float((ours[name].cpu() - theirs[name]).abs()[sure].max()) < 5e-5, name


@pytest.mark.parametrize("names", [("color",), ("alpha", "normal")], ids=",".join)
def test_gradients(device, names):
    made = scene(4)
    cotangents = random_cotangents(made, names, decided(made, LIKE_GSPLAT))
    theirs = gradients(gsplat_torch.rasterize, made.double(), cotangents, LIKE_GSPLAT)
    ours = gradients(rasterize, made.to(device), cotangents, LIKE_GSPLAT)
    for name, gradient in theirs.items():
        if gradient.norm() > 1e-9:
            assert relative(ours[name], gradient) < GRADIENT_TOLERANCE[name], name
