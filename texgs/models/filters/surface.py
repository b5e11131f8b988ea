"""What a filter paints on: the pixels that show the scene, as points on surfaces."""

from __future__ import annotations

from dataclasses import dataclass
from math import log2

from torch import Tensor

from texgs.models.guidance import EditViews

CELLS = 26.0  # patterns along the longest side of the scene
KEY_LIGHT = (-0.45, 0.75, 0.48)  # direction of the light that a drawing's tone is made by, fixed in the world
SOLID = 0.02  # alpha from which a pixel shows enough of the scene to be painted
LOUD = 0.95  # quantile of luminance that counts as white


@dataclass(frozen=True, eq=False)
class Surface:
    """P points. All is fixed to the world, so that views agree on what is painted where."""

    color: Tensor  # [P, 3] straight colours in [0, 1]
    tone: Tensor  # [P] in [0, 1], how light a drawing should be here
    shade: Tensor  # [P] in [0, 1], light of the key light alone
    points: Tensor  # [P, 3] in units of the pattern
    normals: Tensor  # [P, 3] unit length
    pixel: float  # side of a pixel in units of the pattern: edges are as soft as that

    def ramp(self, distance: Tensor) -> Tensor:
        """Return 1 inside, where a signed distance in units of the pattern is negative, 0 outside, softly."""
        return (0.5 - distance / max(self.pixel, 1e-6)).clamp(0, 1)


def surface_of(views: EditViews) -> tuple[Surface, Tensor]:
    """Return the points that views show, and where they are [V, H, W]."""
    where = views.alphas > SOLID
    alpha = views.alphas[where][:, None]
    color = ((views.images[where] - (1 - alpha)) / alpha).clamp(0, 1)
    points, normals = views.points[where], views.normals[where]
    normals = normals / normals.norm(dim=1, keepdim=True).clamp_min(1e-6)
    unit = _side(points) / CELLS
    shade = 0.5 + 0.5 * (normals @ normals.new_tensor(KEY_LIGHT))
    luma = luminance(color)
    white = luma.quantile(LOUD).clamp_min(1e-3) if 0 < len(luma) < 2**24 else luma.new_ones(())
    tone = shade * (luma / white).clamp(0, 1)
    pixel = _pixel(views, points) / unit
    return Surface(color, tone, shade.clamp(0, 1), points / unit, normals, pixel), where


def luminance(colors: Tensor) -> Tensor:
    """Return the luminance [P] of colours [P, 3]."""
    from kornia.color import rgb_to_grayscale

    grey: Tensor = rgb_to_grayscale(colors.T[..., None])[0, :, 0]
    return grey


def _side(points: Tensor) -> float:
    """Return about the longest side of what is seen, world units: a power of sqrt 2, stable over views."""
    side = float((points.amax(dim=0) - points.amin(dim=0)).max()) if len(points) else 1.0
    return float(2 ** (round(2 * log2(max(side, 1e-6))) / 2))


def _pixel(views: EditViews, points: Tensor) -> float:
    """Return the side of a pixel at the middle of the scene, world units."""
    if not len(points):
        return 1.0
    middle = points.mean(dim=0)
    return sum(float((c.position - middle).norm() / c.K[0, 0]) for c in views.cameras) / len(views)
