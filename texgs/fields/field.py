"""The interface of all fields: models that are fitted to views, rendered, edited and saved."""

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from typing import Any, ClassVar, Generic, Literal, NamedTuple, Protocol, Self, TypeVar

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.light import HEADLIGHT, Light
from texgs.core.memory import MIB
from texgs.fields.part_edit import PartEdit, opacity_factors
from texgs.raster import Render

Role = Literal["geometry", "appearance"]
Look = Literal["shaded", "unshaded", "texture", "discs", "ambient", "diffuse", "specular", "shininess"]
F = TypeVar("F", bound="Field")


class Field(Protocol):
    """One basic model of any kind."""

    kind: ClassVar[str]  # its name, one of `texgs.fields.kinds.kinds()`

    def __len__(self) -> int:
        """Return the number of primitives: surfels, Gaussians, voxels."""

    @property
    def device(self) -> torch.device:
        """The device of its tensors."""

    @property
    def metadata(self) -> Mapping[str, Any]:
        """Its origin, as JSON."""

    def to(self, device: torch.device | str) -> Self:
        """Return the same field on another device."""

    def tensors(self, role: Role) -> Mapping[str, Tensor]:
        """Return the raw parameters of a role: geometry or appearance."""

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
        """Return MiB by contents and `total_mib` as in the paper, and `stored_` sizes as in files.

        `files_mib` is the total as the paper's tables of edits count.
        """


class Asked(NamedTuple):
    """Options of a view, see `Composed.render`."""

    background: Tensor | None
    outputs: Collection[str]
    depth_range: Tensor | None


class Composed(ABC):
    """Fields of one kind as a scene. Edits are in order: for each field its own, then one per segment."""

    device: torch.device  # of its tensors

    @abstractmethod
    def __len__(self) -> int:
        """Return the number of primitives of all fields."""

    @property
    @abstractmethod
    def palettes(self) -> list[tuple[float, ...]]:
        """The fitted colour of each field, which edits replace; black for fields without one."""

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
        return self._draw(camera, light, edits, look, Asked(background, outputs, depth_range))

    @abstractmethod
    def _draw(
        self, camera: Camera, light: Light, edits: Sequence[PartEdit] | None, look: Look, asked: Asked
    ) -> Render:
        """Render one view of all visible fields, see `render`."""


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


class UnlitField(ABC):
    """A field with the light of its views baked into its colours."""

    kind: ClassVar[str]

    def render(
        self,
        camera: Camera,
        light: Light = HEADLIGHT,
        *,
        background: Tensor | None = None,
        outputs: Collection[str] = (),
    ) -> Render:
        """Render one view, see `Field`; light has no effect."""
        return self.draw(camera, background, outputs)

    @abstractmethod
    def draw(self, camera: Camera, background: Tensor | None, outputs: Collection[str]) -> Render:
        """Render the field with its own colours."""


class UnlitScene(Composed, Generic[F]):
    """Fields of one kind that are drawn together.

    There is at least one, all are on one device, and none has segments. Light has no effect.
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

    def _draw(
        self, camera: Camera, light: Light, edits: Sequence[PartEdit] | None, look: Look, asked: Asked
    ) -> Render:
        if look != "shaded":
            raise ArgumentError(
                f"look: expected shaded, got {look}; {self.kind} have light in their colours, fit surfels"
            )
        factors = opacity_factors(edits, len(self.counts), self.kind)
        return self._blend(factors, camera, asked)

    @abstractmethod
    def _blend(self, factors: Sequence[float], camera: Camera, asked: Asked) -> Render:
        """Render all fields, each with a factor on its opacity."""


def require_depth(outputs: Collection[str], kind: str) -> None:
    """Refuse outputs other than the depth."""
    if unknown := sorted(set(outputs) - {"depth"}):
        raise ArgumentError(f"outputs: expected depth of {kind}, got {unknown[0]}")
