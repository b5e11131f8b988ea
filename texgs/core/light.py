"""The one light of a view or of a scene."""

from dataclasses import dataclass
from math import isfinite
from typing import Literal

import numpy as np
from torch import Tensor

from texgs.core.camera import Camera, orbit_direction
from texgs.core.errors import ArgumentError


@dataclass(frozen=True)
class Light:
    """White light from one direction: from the camera, or fixed in the world."""

    kind: Literal["headlight", "directional"]
    azimuth: float = 0.0  # degrees, of a directional light; see orbit_direction
    polar: float = 0.0  # degrees above the horizon

    def __post_init__(self) -> None:
        if self.kind not in ("headlight", "directional"):
            raise ArgumentError(f"light: expected headlight or directional, got {self.kind!r}")
        if not isfinite(self.azimuth):
            raise ArgumentError(f"light: expected an azimuth in degrees, got {self.azimuth:g}")
        if not abs(self.polar) <= 90:
            raise ArgumentError(f"light: expected a polar angle from -90 to 90 degrees, got {self.polar:g}")

    def direction(self, camera: Camera) -> Tensor:
        """Return the unit vector [3], float64, from the origin to the light or headlight."""
        if self.kind == "directional":
            return orbit_direction(self.azimuth, self.polar)
        position: Tensor = camera.position.double().cpu()
        return position.div(position.norm())


HEADLIGHT = Light("headlight")


def random_lights(count: int, *seed: int) -> list[Light]:
    """Return lights from random directions, all alike likely; more of the same seed begin with the same ones.

    The height of a point that is uniform on the sphere is uniform itself (Archimedes).
    """
    turns, heights = np.random.default_rng(seed).random((count, 2)).T
    angles = zip(360 * turns - 180, np.degrees(np.arcsin(2 * heights - 1)), strict=True)
    return [Light("directional", float(azimuth), float(polar)) for azimuth, polar in angles]
