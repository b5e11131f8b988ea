"""The definition against gsplat's own functions on small scenes.

gsplat caps alpha at 0.999, we at 0.99 as 3DGS does: opacities stay below. Of surfels it has no near plane for
fragments and no depth but that of the mean: neither is compared. Its antialiased factor has no least value.
"""

from dataclasses import replace

import pytest
import torch

from tests.raster import gsplat_torch
from tests.raster.agreement import images
from tests.raster.scenes import gaussians, random_scene
from texgs.raster.reference import render as reference
from texgs.raster.types import Options

CASES = {  # what is drawn, and options
    "surfels": ("surfels", Options(low_pass=2.0, filter_sigma=1.0, near=0.01, far=1e10)),
    "3DGS": ("gaussians", Options()),
    "3DGS antialiased": ("gaussians", Options(antialiased=True)),
    "3DGS as gsplat": ("gaussians", Options(near=0.01, dilation=0.5)),
}
THEIRS = {"surfels": gsplat_torch.rasterize, "gaussians": gsplat_torch.rasterize_gaussians}
OTHER = {"surfels": "normal", "gaussians": "depth"}  # image beside colour and alpha


def scene(kind, seed, channels=3):
    """A random scene without opacities above both caps; every fifth Gaussian far off the view's axis."""
    made = random_scene(seed, n=150, width=41, height=30, channels=channels)
    made = replace(made, opacities=0.98 * made.opacities)
    if kind == "surfels":
        return made
    aside = 1.6 * made.viewmat[0, :3] * (torch.arange(150) % 5 == 0)[:, None]
    return replace(gaussians(made), means=made.means + aside)


@pytest.mark.parametrize(("seed", "channels"), [(0, 3), (1, 3), (2, 8)])
@pytest.mark.parametrize("case", CASES)
def test_definition(case, seed, channels):
    kind, options = CASES[case]
    made = scene(kind, seed, channels).double()
    ours, theirs = (
        images(made.render(function, (OTHER[kind],), options))
        for function in (reference.rasterize, THEIRS[kind])
    )
    for name in ("color", "alpha", OTHER[kind]):
        # gsplat's normals are in camera axes, and a rotation rounded to float32 is not quite orthogonal
        tolerance = 1e-6 if name == "normal" else 1e-9
        assert float((ours[name] - theirs[name]).abs().max()) < tolerance, name
