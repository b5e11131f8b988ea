"""Shots of a scene: viewpoint and mode of a picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from texgs.core.keys import key
from texgs.core.lens import Frame, LensKeys

if TYPE_CHECKING:
    from texgs.core.camera import Camera

Mode = Literal[
    "shaded",
    "volume",
    "unshaded",
    "normal",
    "depth",
    "alpha",
    "texture",
    "discs",
    "ambient",
    "diffuse",
    "specular",
    "shininess",
]


@dataclass(frozen=True)
class Shot(LensKeys):
    """Viewpoint and mode of a picture."""

    azimuth: float | None = key(
        None,
        "of the camera, not on path test; on an orbit of the first frame; default the scene's, 30 where it "
        "says no other",
        "degrees",
    )
    polar: float = key(20.0, "of the camera above the horizon, not on path test", "degrees")
    mode: Mode = key("shaded", "what a picture shows; the last four are factors of the material")
    transparent: bool = key(False, "leave the background out: pictures have an alpha channel")
    legend: bool = key(False, "show names, colours and ranges of values in a corner")

    def camera(self, framed: Frame) -> Camera:
        """Return the camera; by default it shows the whole frame."""
        from texgs.core.camera import orbit

        azimuth = framed.azimuth if self.azimuth is None else self.azimuth
        return orbit(azimuth, self.polar, *self.lens(framed))
