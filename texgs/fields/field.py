"""What all fields have in common: things that are fitted to views, drawn, edited and saved."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any, ClassVar, Literal, Protocol, Self

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.light import HEADLIGHT, Light
from texgs.fields.part_edit import PartEdit
from texgs.raster import Render

Role = Literal["geometry", "appearance"]
Look = Literal["shaded", "unshaded", "texture", "discs", "ambient", "diffuse", "specular", "shininess"]


class Field(Protocol):
    """One basic model, of whatever it is made."""

    kind: ClassVar[str]
    """Name of its kind, one of `texgs.fields.kinds.kinds()`."""

    def __len__(self) -> int:
        """Primitives: surfels, Gaussians, voxels."""
        ...

    @property
    def device(self) -> torch.device:
        """Where its tensors are."""
        ...

    @property
    def metadata(self) -> Mapping[str, Any]:
        """Where it is from, as JSON."""
        ...

    def to(self, device: torch.device | str) -> Self:
        """The same field on another device."""
        ...

    def tensors(self, role: Role) -> Mapping[str, Tensor]:
        """Raw parameters that decide where it is, or how it looks; what learns is among them."""
        ...

    def render(
        self,
        camera: Camera,
        light: Light = HEADLIGHT,
        *,
        background: Tensor | None = None,
        outputs: Collection[str] = (),
    ) -> Render:
        """One view, over white by default; `depth` and `normal` where `outputs` asks for them.

        Raises:
            ArgumentError: for an output that fields of this kind do not have.
        """
        ...

    def sizes(self) -> dict[str, float]:
        """MiB by contents, and `total_mib`, as the paper's break-down counts; `stored_`, as in a file.

        `files_mib` is the total as the paper's tables of edits count.
        """
        ...


class Composed(Protocol):
    """Fields of one kind as a scene. Edits are one for each field, behind it one for each of its segments."""

    def __len__(self) -> int:
        """Primitives of all fields."""
        ...

    @property
    def device(self) -> torch.device:
        """Where its tensors are."""
        ...

    @property
    def palettes(self) -> list[tuple[float, ...]]:
        """The colour of each field as fitted, which edits replace; black for those without one."""
        ...

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
        """One view with edits.

        Raises:
            ArgumentError: if there are not as many edits as parts, or fields of this kind cannot show one.
        """
        ...
