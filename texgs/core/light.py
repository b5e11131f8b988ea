"""The one light of a view or of a scene."""

from dataclasses import dataclass, replace
from math import isfinite
from typing import Literal, Self

import numpy as np
from torch import Tensor

from texgs.core.camera import Camera, orbit_direction
from texgs.core.errors import ArgumentError

HIDING = ("shadows", "occlusion", "reach")  # values of a light that say how matter hides it
MAX_REACH = 2.0  # world units: through all of a volume, whose longest side is 1


@dataclass(frozen=True)
class Light:
    """White light from one direction: from the camera, or fixed in the world.

    Shadows take away diffuse light and highlights of a directional light, occlusion takes away ambient light.
    """

    kind: Literal["headlight", "directional"]
    azimuth: float = 0.0  # degrees, of a directional light; see orbit_direction
    polar: float = 0.0  # degrees above the horizon
    shadows: float = 0.0  # share of the light that matter in its way takes away: 0 nothing, 1 all it can
    occlusion: float = 0.0  # the same of ambient light, which comes from all around
    reach: float = 0.25  # how far matter is that hides ambient light, world units

    def __post_init__(self) -> None:
        if self.kind not in ("headlight", "directional"):
            raise ArgumentError(f"kind: expected headlight or directional, got {self.kind!r}")
        if not isfinite(self.azimuth):
            raise ArgumentError(f"azimuth: expected degrees, got {self.azimuth:g}")
        if not abs(self.polar) <= 90:
            raise ArgumentError(f"polar: expected -90 to 90 degrees, got {self.polar:g}")
        for name in ("shadows", "occlusion"):
            if not 0 <= getattr(self, name) <= 1:
                raise ArgumentError(f"{name}: expected a share from 0 to 1, got {getattr(self, name):g}")
        if not 0 < self.reach <= MAX_REACH:
            raise ArgumentError(f"reach: expected above 0 to {MAX_REACH:g} world units, got {self.reach:g}")

    @property
    def casts_shadows(self) -> bool:
        """Return whether matter hides any light; a headlight shines along the rays of the eye."""
        return self.occlusion > 0 or (self.shadows > 0 and self.kind == "directional")

    @property
    def unhidden(self) -> Self:
        """Return the same light without shadows and occlusion."""
        return replace(self, shadows=0.0, occlusion=0.0)

    def turned(self, azimuth: float, polar: float) -> Self:
        """Return the light from a direction, see `orbit_direction`, with the same shadows and occlusion."""
        return replace(self, kind="directional", azimuth=azimuth, polar=polar)

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
