"""What fields with light in their colours have in common: in a scene, only their opacity changes."""

from abc import ABC, abstractmethod
from collections.abc import Collection, Sequence
from typing import ClassVar, Generic, NamedTuple, TypeVar

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.light import HEADLIGHT, Light
from texgs.fields.field import Field, Look
from texgs.fields.part_edit import PartEdit, opacity_factors
from texgs.raster import Render

F = TypeVar("F", bound=Field)


class Asked(NamedTuple):
    """What is asked of a view, see `Composed.render`."""

    background: Tensor | None
    outputs: Collection[str]
    depth_range: Tensor | None


class UnlitField(ABC):
    """A field whose colours have the light of its views in them."""

    kind: ClassVar[str]

    def render(
        self,
        camera: Camera,
        light: Light = HEADLIGHT,
        *,
        background: Tensor | None = None,
        outputs: Collection[str] = (),
    ) -> Render:
        """Render one view, see `Field`; light changes nothing."""
        return self.draw(camera, background, outputs)

    @abstractmethod
    def draw(self, camera: Camera, background: Tensor | None, outputs: Collection[str]) -> Render:
        """Render the field with the colours that it has."""


class UnlitScene(ABC, Generic[F]):
    """Fields of one kind that are drawn together.

    There is at least one, all are on one device, and none has segments.
    """

    def __init__(self, fields: Sequence[F], segments: Sequence[Sequence[Tensor]] = ()) -> None:
        if not fields:
            raise ArgumentError("models: expected at least one, got none")
        if any(segments):
            raise ArgumentError(f"segments: expected none of {fields[0].kind}, got some; remove them")
        self.fields, self.kind, self.device = list(fields), fields[0].kind, fields[0].device
        self.counts = [len(field) for field in fields]

    def __len__(self) -> int:
        return sum(self.counts)

    @property
    def palettes(self) -> list[tuple[float, ...]]:
        """Black for each field: edits of a scene replace no palette."""
        return [(0.0, 0.0, 0.0)] * len(self.counts)

    @torch.no_grad()
    def render(
        self,
        camera: Camera,
        light: Light = HEADLIGHT,
        edits: Sequence[PartEdit] | None = None,
        *,
        look: Look = "shaded",
        background: Tensor | None = None,
        outputs: Collection[str] = (),
        depth_range: Tensor | None = None,
    ) -> Render:
        """Render one view, see `Composed`; light changes nothing, and the look is "shaded"."""
        if look != "shaded":
            raise ArgumentError(
                f"look: expected shaded, got {look}; {self.kind} have light in their colours, fit surfels"
            )
        factors = opacity_factors(edits, len(self.counts), self.kind)
        return self._blend(factors, camera, Asked(background, outputs, depth_range))

    @abstractmethod
    def _blend(self, factors: Sequence[float], camera: Camera, asked: Asked) -> Render:
        """Render all fields, each with a factor on its opacity."""


def require_depth(outputs: Collection[str], kind: str) -> None:
    """Require that no other output is asked for than the depth."""
    if unknown := sorted(set(outputs) - {"depth"}):
        raise ArgumentError(f"outputs: expected depth of {kind}, got {unknown[0]}")
