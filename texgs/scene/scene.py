"""A scene: fields by name with their edits, a light, a background; opening it trains nothing."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Self

import torch
from torch import Tensor

from texgs.core.cuts import NO_CUTS, Cuts
from texgs.core.errors import ArgumentError, errors_at
from texgs.core.lens import Frame
from texgs.core.light import HEADLIGHT, Light
from texgs.core.markers import Marker
from texgs.core.names import is_number
from texgs.fields.field import Composed, Field
from texgs.fields.files import open_field
from texgs.fields.kinds import kinds
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.step_file import at_step
from texgs.fields.surfels.texels import reduce_constant_textures
from texgs.fields.surfels.variants import labels_of, with_texture, with_variants
from texgs.scene.bounds import bounds_of, models_of
from texgs.scene.segment_file import read_segment
from texgs.scene.series_file import Series
from texgs.volume.grid import Grid
from texgs.volume.nrrd_file import masks_in, open_grid
from texgs.volume.render import Appearance
from texgs.volume.space import Space
from texgs.volume.transfer import TransferFunction

WHITE = (1.0, 1.0, 1.0)
MAX_FUNCTIONS = 32


@dataclass(frozen=True)
class SceneVolume:
    """The volume that a scene was fitted to, with the functions and appearance of its views."""

    file: Path  # volume.nrrd, prepared
    tfs: Mapping[str, TransferFunction]  # basic TFs, by the names of models
    appearance: Appearance = field(default_factory=Appearance)
    labels: tuple[str, ...] = ()  # of its masks, in whose order functions have their numbers

    def open(self) -> Grid:
        """Map the volume into memory.

        Raises:
            ArgumentError: if it cannot be read, or was made again with masks of other labels.
        """
        grid, expected = open_grid(self.file), ", ".join(self.labels)
        if expected and expected != (now := ", ".join(masks_in(self.file))):
            raise ArgumentError(
                f"{self.file}: expected masks of the labels {expected}, as the scene has them, got "
                f"{now or 'none'}; make the scene again by texgs compose"
            )
        return grid


@dataclass(frozen=True)
class SceneSegment:
    """Surfels of a model with their own edit, which replaces the model's."""

    file: Path  # mask of surfels, see `write_segment`
    edit: PartEdit = field(default_factory=PartEdit)
    texture: Path | None = None  # variant of the whole model; supplies the texels of these surfels


@dataclass(frozen=True)
class SceneModel:
    """One model of a scene.

    Segments have an order: a surfel that two of them hold belongs to the first.
    """

    file: Path  # lossless or compact
    edit: PartEdit = field(default_factory=PartEdit)  # of surfels outside all segments
    texture: Path | None = None  # variant that replaces the model's own texels
    segments: Mapping[str, SceneSegment] = field(default_factory=dict)
    step: Path | None = None  # file with the surfels of a step of a series, see `Scene.at`

    @property
    def edits(self) -> list[PartEdit]:
        """Return the model's edit, followed by the edits of its segments."""
        return [self.edit, *(segment.edit for segment in self.segments.values())]

    @property
    def files(self) -> list[Path | None]:
        """Return all files that `open` reads."""
        paths = [self.file, self.texture, self.step]
        for segment in self.segments.values():
            paths += [segment.file, segment.texture]
        return paths

    def open(self) -> tuple[Field, list[Tensor]]:
        """Read the field, surfels with the texels of all variants, and the masks [N] of its segments."""
        fitted = open_field(self.file)
        if isinstance(fitted, Surfels) or self.texture is not None or self.segments or self.step:
            return self.surfels(fitted)
        return fitted, []

    def surfels(self, fitted: Field | None = None) -> tuple[Surfels, list[Tensor]]:
        """Return the same, for what only surfels can; another kind of field is refused.

        Args:
            fitted: what the file holds, where that is known.
        """
        fitted = open_field(self.file) if fitted is None else fitted
        if not isinstance(fitted, Surfels):
            raise ArgumentError(f"{self.file}: expected surfels, got {fitted.kind}; fit surfels for this")
        placed = fitted if self.step is None else at_step(fitted, self.step)
        model = placed if self.texture is None else with_texture(placed, self.texture)
        masks, variants = [], []
        for name, segment in self.segments.items():
            with errors_at(f"segments.{name}"):
                masks.append(read_segment(segment.file, fitted))
                own = placed if segment.texture is None else with_texture(placed, segment.texture)
            variants.append(own)
        if masks and fitted.stage == "texture":
            model = with_variants(model, labels_of(masks, len(model)), variants)
        return model, masks


@dataclass(frozen=True)
class Scene:
    """Models by name in order of addition, and settings common to all."""

    models: Mapping[str, SceneModel]
    light: Light = HEADLIGHT
    background: tuple[float, float, float] = WHITE
    cuts: Cuts = NO_CUTS
    volume: SceneVolume | None = None  # that the models were fitted to, see `Twin`
    frame: Frame | None = None  # ball of the visible volume, if known
    functions: Mapping[str, TransferFunction] = field(default_factory=dict)  # for the mode `volume`
    series: Series | None = None  # in time; the scene shows one step of it
    time: int | None = None  # number of the shown step
    space: Space | None = None  # of the volume's file, if known
    markers: tuple[Marker, ...] = ()  # drawn on top of pictures

    def __post_init__(self) -> None:
        if not self.models:
            raise ArgumentError("models: expected at least one, got none")
        if len(self.functions) > MAX_FUNCTIONS:
            raise ArgumentError(f"functions: expected at most {MAX_FUNCTIONS}, got {len(self.functions)}")

    @property
    def edits(self) -> list[PartEdit]:
        """Return the edits of all models, each followed by the edits of its segments."""
        return [edit for model in self.models.values() for edit in model.edits]

    def framed(self, composed: Composed | None = None) -> Frame:
        """Return the frame of pictures: that of the data, or the bounds of the models.

        Args:
            composed: the models, where they are open.
        """
        return self.frame or bounds_of(models_of(self.open() if composed is None else composed))

    @property
    def as_fitted(self) -> Self:
        """Return the scene without edits of its models; light, background and cuts stay."""
        models = {name: SceneModel(model.file, step=model.step) for name, model in self.models.items()}
        return replace(self, models=models)

    @property
    def timeline(self) -> Series:
        """Return its series; raise an error without one."""
        if self.series is None:
            raise ArgumentError("time: expected a scene of a series, got one without; texgs series makes one")
        return self.series

    def at(self, time: Any) -> Self:
        """Return the scene at a step of its series, with the step's models and volume; edits stay."""
        series, last = self.timeline, len(self.timeline.steps) - 1
        if not is_number(time) or time not in range(last + 1):
            raise ArgumentError(f"time: expected the number of a step, 0 to {last}, got {time!r:.100}")
        step = int(time)
        models = {
            name: replace(entry, step=series.model(name, step)) if name in series.models else entry
            for name, entry in self.models.items()
        }
        volume = self.volume and replace(self.volume, file=series.volume(step))
        return replace(self, models=models, volume=volume, time=step)

    @property
    def has_looks(self) -> bool:
        """Return whether a part has texels that were not fitted, which its volume cannot show."""
        textures = [model.texture for model in self.models.values()]
        textures += [segment.texture for model in self.models.values() for segment in model.segments.values()]
        return any(textures)

    @property
    def is_as_volume(self) -> bool:
        """Return whether its volume can show all edits: no looks, no segments apart, and one material."""
        models = self.models.values()
        is_apart = any(part.edit != model.edit for model in models for part in model.segments.values())
        materials = {model.edit.material for model in models if model.edit.visible and model.edit.opacity > 0}
        return not (self.has_looks or is_apart or len(materials) > 1)

    @property
    def shows_volume(self) -> bool:
        """Return whether frames show its volume instead of its cut models."""
        return bool(self.cuts) and self.volume is not None and self.is_as_volume

    def open(self, device: torch.device | str = "cpu", *, is_lean: bool = False) -> Composed:
        """Read and join the models.

        Args:
            device: that they are on.
            is_lean: constant textures have one texel, see `reduce_constant_textures`.

        Raises:
            ArgumentError, ShapeError: naming the model and its file.
        """
        models, segments = [], []
        for name, entry in self.models.items():
            with errors_at(f"models.{name}"):
                model, masks = entry.open()
            models.append((reduce_constant_textures(model) if is_lean else model).to(device))
            segments.append([mask.to(device) for mask in masks])
        made_of = sorted({model.kind for model in models})
        if len(made_of) > 1:
            raise ArgumentError(f"models: expected fields of one kind, got {' and '.join(made_of)}")
        composed: Composed = kinds()[made_of[0]].compose(models, segments)
        return composed


def volume_of(scene: Scene) -> SceneVolume:
    """Return the volume of a scene; raise an error without one."""
    if scene.volume is None:
        raise ArgumentError(
            "volume: expected the volume that the scene was made from, got none; make the scene again by "
            "texgs compose"
        )
    return scene.volume
