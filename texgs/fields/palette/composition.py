"""Palette fields as one scene, in which densities add up."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from torch import Tensor

from texgs.core.camera import Camera
from texgs.fields.palette.model import PaletteField, render_fields
from texgs.fields.unlit import UnlitScene
from texgs.raster import Render


class PaletteScene(UnlitScene[PaletteField]):
    """Fields that are drawn together, see `UnlitScene`; opacity is a factor on densities."""

    def __init__(self, fields: Sequence[PaletteField], segments: Sequence[Sequence[Tensor]] = ()) -> None:
        super().__init__(fields, segments)
        self.fields = list(fields)

    def _blend(
        self, factors: Sequence[float], camera: Camera, background: Tensor | None, outputs: Collection[str]
    ) -> Render:
        return render_fields(self.fields, factors, camera, background, outputs)
