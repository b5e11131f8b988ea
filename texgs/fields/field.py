"""What all fields have in common: things that are fitted to views, drawn, edited and saved."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any, ClassVar, Literal, Protocol, Self

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.light import HEADLIGHT, Light
from texgs.core.memory import MIB
from texgs.fields.part_edit import PartEdit
from texgs.raster import Render

Role = Literal["geometry", "appearance"]
Look = Literal["shaded", "unshaded", "texture", "discs", "ambient", "diffuse", "specular", "shininess"]


class Field(Protocol):
    """One basic model, of whatever it is made."""

    kind: ClassVar[str]  # its name, one of `texgs.fields.kinds.kinds()`

    def __len__(self) -> int:
        """Return the number of primitives: surfels, Gaussians, voxels."""

    @property
    def device(self) -> torch.device:
        """Where its tensors are."""

    @property
    def metadata(self) -> Mapping[str, Any]:
        """Where it is from, as JSON."""

    def to(self, device: torch.device | str) -> Self:
        """Return the same field on another device."""

    def tensors(self, role: Role) -> Mapping[str, Tensor]:
        """Return raw parameters that decide where it is, or how it looks; what learns is among them."""

    def render(
        self,
        camera: Camera,
        light: Light = HEADLIGHT,
        *,
        background: Tensor | None = None,
        outputs: Collection[str] = (),
    ) -> Render:
        """Render one view.

        Args:
            camera: on the field's device.
            light: shines on fields that can be relit; others have the light of their views in their colours.
            background: [3]; white by default.
            outputs: besides colour and alpha, such as `depth` and `normal`.

        Raises:
            ArgumentError: for an output that fields of this kind do not have.
        """

    def sizes(self) -> dict[str, float]:
        """Return MiB by contents, and `total_mib`, as the paper's break-down counts; `stored_`, as in a file.

        `files_mib` is the total as the paper's tables of edits count.
        """


class Composed(Protocol):
    """Fields of one kind as a scene. Edits are one for each field, behind it one for each of its segments."""

    def __len__(self) -> int:
        """Return the number of primitives of all fields."""

    @property
    def device(self) -> torch.device:
        """Where its tensors are."""

    @property
    def palettes(self) -> list[tuple[float, ...]]:
        """The colour of each field as fitted, which edits replace; black for those without one."""

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
        """Render one view of all visible fields.

        Args:
            camera: on the fields' device.
            light: shines on all fields that can be relit.
            edits: one for each part; by default nothing is changed.
            look: what colour shows: with light; without; texels alone, around grey; surfels as opaque discs
                of one standard deviation, with light and without texels; or one factor of the material.
            background: [3]; white by default, for a factor black.
            outputs: besides colour and alpha.
            depth_range: [2, H, W] camera z from which on, and before which, a pixel shows something.

        Raises:
            ArgumentError: if there are not as many edits as parts, or fields of this kind cannot show one.
        """


def sizes_in_mib(
    counted: Mapping[str, int], stored: Mapping[str, int], n_files: int | None = None
) -> dict[str, float]:
    """Return sizes in MiB by contents, see `Field.sizes`, from bytes of groups as the paper counts them.

    `stored` are bytes of the same groups in a file, `n_files` those that the paper's tables of edits count;
    by default all that is counted.
    """
    total = sum(counted.values())
    sizes = {**counted, "total": total, "files": total if n_files is None else n_files}
    sizes |= {f"stored_{group}": count for group, count in {**stored, "total": sum(stored.values())}.items()}
    return {f"{group}_mib": count / MIB for group, count in sizes.items()}
