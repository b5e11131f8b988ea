"""Light for the surfels of a page without a volume: which shares of any lamp and of the sky reach them."""

import zlib
from dataclasses import dataclass
from math import asin, atan2, degrees

import numpy as np
import torch
from torch import Tensor

from texgs.core.light import Light
from texgs.fields.surfels.composition import Composition
from texgs.scene.exposure import lamp_shares, places_of, sky_shares
from texgs.scene.scene import Scene
from texgs.scene.twin import Twin
from texgs.volume.matter import even_directions

MEGABYTE = 10**6
LEVELS = 255  # the largest code of 8 bits
LAMPS = 64  # directions from which a visibility is known


@dataclass(frozen=True, eq=False)
class PageLight:
    """Openness and nine harmonics of the visibility of a lamp, as codes of 8 bits."""

    codes: np.ndarray  # [10, N] uint8
    scales: list[list[float]]  # [10, 2] of each row: what code 0 stands for, and a step between codes

    def packed(self, first: int, count: int) -> np.ndarray:
        """Return the codes [10, count] of some surfels, each as its difference from the one before.

        Deflate packs these smaller: neighbours in space are near each other.
        """
        return np.diff(self.codes[:, first : first + count], axis=1, prepend=np.uint8(0))

    def __str__(self) -> str:
        """Say what it is, and how large."""
        count = self.codes.shape[1]
        size = len(zlib.compress(self.packed(0, count).tobytes(), 9)) * 4 / 3  # as base64
        return f"shadows and occlusion of {count} surfels in {size / MEGABYTE:.2f} MB"


def page_light(scene: Scene, composed: Composition, twin: Twin) -> PageLight:
    """Return what a page needs for shadows of a scene as it is; it shows at least one model."""
    matter, lamps = twin.matter(scene, composed.palettes), even_directions(LAMPS)
    places = places_of(composed, matter)
    rows = composed.means.new_zeros(10, len(composed))
    rows[0] = sky_shares(composed, matter.lit(None, scene.light.reach), places)
    for lamp, fit in zip(lamps, torch.linalg.pinv(harmonics(lamps)).T, strict=True):  # least squares
        rows[1:] += torch.outer(fit, lamp_shares(composed, lamp_at(lamp), matter.lit(lamp, None), places))
    low, high = rows.aminmax(dim=1, keepdim=True)
    low[0], high[0] = 0, 1
    step = (high - low).clamp_min(1e-6) / LEVELS
    codes = ((rows - low) / step).round().to(torch.uint8).numpy()
    return PageLight(codes, torch.cat([low, step], dim=1).tolist())


def lamp_at(direction: Tensor) -> Light:
    """Return the lamp in a direction [3]; see `orbit_direction`."""
    x, y, z = direction.double().tolist()
    return Light("directional", degrees(atan2(-z, x)), degrees(asin(min(max(y, -1.0), 1.0))))


def harmonics(directions: Tensor) -> Tensor:
    """Return real spherical harmonics [N, 9] of degrees 0 to 2 at unit vectors [N, 3], without constants."""
    x, y, z = directions.unbind(dim=1)
    return torch.stack([x**0, x, y, z, x * y, y * z, z * x, x * x - y * y, 3 * z * z - 1], dim=1)
