"""Palette fields as one scene, in which densities add up."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.light import HEADLIGHT, Light
from texgs.fields.field import Look
from texgs.fields.palette.model import PaletteField, render_fields
from texgs.fields.part_edit import PartEdit, opacity_factors
from texgs.raster import Render


class PaletteScene:
    """Fields that are drawn together.

    Args:
        fields: at least one.

    Raises:
        ArgumentError: if there is none.
    """

    def __init__(self, fields: Sequence[PaletteField]) -> None:
        if not fields:
            raise ArgumentError("models: expected at least one, got none")
        self.fields = list(fields)

    def __len__(self) -> int:
        return sum(map(len, self.fields))

    @property
    def device(self) -> torch.device:
        """The CPU."""
        return self.fields[0].device

    @property
    def palettes(self) -> list[tuple[float, ...]]:
        """Black for each field: edits of a scene replace no palette."""
        return [(0.0, 0.0, 0.0)] * len(self.fields)

    def render(
        self,
        camera: Camera,
        light: Light = HEADLIGHT,
        edits: Sequence[PartEdit] | None = None,
        *,
        look: Look = "shaded",
        background: Tensor | None = None,
        outputs: Collection[str] = (),
    ) -> Render:
        """Render all visible fields.

        Args:
            camera: from where.
            light: changes nothing.
            edits: one for each field; opacity is a factor on densities.
            look: "shaded", as fitted.
            background: [3]; white by default.
            outputs: "depth".

        Raises:
            ArgumentError: if there are not as many edits as fields, or one cannot be shown.
        """
        if look != "shaded":
            raise ArgumentError(f"look: expected shaded of palette fields, got {look}")
        factors = opacity_factors(edits, len(self.fields), PaletteField.kind)
        return render_fields(self.fields, factors, camera, background, outputs)
