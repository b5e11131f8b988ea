"""Learning rates of raw parameters of surfels and 3D Gaussians, by name."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.fields.optimizer import Rate
from texgs.fit.settings import Rates
from texgs.raster.shading import MATERIAL

USUAL_DISTANCE = 4.0  # of cameras, in radii of the object
SMALLEST = 1e-3  # distance, world units


def extent(cameras: Sequence[Camera], means: Tensor) -> float:
    """The length that rates of means, and sizes of density control, refer to.

    1.1 times the largest distance of a camera from the cameras' mean. One camera, or some inside of the
    object, have none to speak of: they count as far away as an object is usually seen from.
    """
    around = spread(torch.stack([camera.position for camera in cameras]))
    radius = spread(means)
    return 1.1 * max(around if around > radius else USUAL_DISTANCE * radius, SMALLEST)


def spread(points: Tensor) -> float:
    """Largest distance of points [N, 3] from their mean; 0 for none."""
    return float((points - points.mean(dim=0)).norm(dim=1).max()) if len(points) else 0.0


def rates(names: Iterable[str], r: Rates, size: float) -> dict[str, Rate]:
    """Learning rate of each parameter that learns; `size` is the extent of the cameras."""
    starts = {"quats": r.quats, "scales": r.scales, "opacities": r.opacities, "colors": r.colors}
    starts |= {"sh": r.sh, "sh_rest": r.sh_rest, **dict.fromkeys(MATERIAL, r.material)}
    chosen = {name: Rate(starts[name], r.final) for name in names if name in starts}
    chosen["means"] = Rate(size * r.means, r.means_final)
    return {name: rate for name, rate in chosen.items() if rate.start > 0}
