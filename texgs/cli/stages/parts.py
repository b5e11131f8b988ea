"""Parts of a scene that an edit gives a new look: whole models, or segments of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from texgs.core.errors import ArgumentError
from texgs.core.names import part_file
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.segment import labels_of
from texgs.fields.surfels.texture_file import write_texture
from texgs.scene.scene_file import Scene, SceneModel
from texgs.volume.view_set import View, read_views

Editor = Callable[[str, Surfels, Tensor | None], tuple[Surfels, dict[str, Any]]]


@dataclass(frozen=True)
class Part:
    """A model of a scene, or a segment of it."""

    model: str
    segment: str | None = None

    @property
    def name(self) -> str:
        """As it is written: MODEL or MODEL/SEGMENT."""
        return self.model if self.segment is None else f"{self.model}/{self.segment}"

    @property
    def file(self) -> str:
        """Name of the file of its texture."""
        return part_file("edit.parts", self.name)


def parts_of(scene: Scene, names: Sequence[str]) -> list[Part]:
    """The parts that have these names; all models by default.

    Raises:
        ArgumentError: naming the one that is not in the scene, or there twice.
    """
    known = [Part(model) for model in scene.models]
    known += [Part(model, segment) for model, entry in scene.models.items() for segment in entry.segments]
    by_name = {part.name: part for part in known}
    for name in names:
        if name not in by_name:
            raise ArgumentError(f"edit.parts: expected some of {', '.join(by_name)}, got {name}")
        if names.count(name) > 1:
            raise ArgumentError(f"edit.parts: expected different names, got {name} twice")
    return [by_name[name] for name in names] or [Part(model) for model in scene.models]


def views_of(inputs: Mapping[str, Path], part: str) -> Sequence[View]:
    """Training views of the model of a part.

    Raises:
        ArgumentError: if the model is none of the data set's.
    """
    model = part.split("/")[0]
    if f"views.{model}" not in inputs:
        known = ", ".join(name.removeprefix("views.") for name in inputs if name.startswith("views."))
        raise ArgumentError(
            f"scene: expected models named after basic TFs of the data set ({known}), got {model}"
        )
    return read_views(inputs[f"views.{model}"].parent).train


def shares(name: str, points: Sequence[Any]) -> list[list[float]]:
    """Clicks as shares of the sides of a picture.

    Raises:
        ArgumentError: naming the key, if one is no place in the picture.
    """
    for point in points:
        is_pair = isinstance(point, list) and len(point) == 2
        if not is_pair or not all(isinstance(x, int | float) and 0 <= x < 1 for x in point):
            raise ArgumentError(f"{name}: expected two shares from 0 to 1, got {point}")
    return list(points)


def edit_parts(
    scene: Scene, names: Sequence[str], output: Path, device: torch.device, edit: Editor
) -> tuple[Scene, dict[str, dict[str, Any]]]:
    """Edit parts one after the other, each alone, and write their textures.

    Args:
        scene: as it is before.
        names: of the parts; all models by default.
        output: folder of the files.
        device: that works.
        edit: from the name of a part, its model with the textures that it has, and the surfels that may
            change (None: all), to the edited model and what is to be told about it.

    Returns:
        The scene with the new textures, and what is to be told by name of the part.
    """
    found: dict[str, dict[str, Any]] = {}
    for part in parts_of(scene, names):
        entry = scene.models[part.model]
        model, masks = entry.open()
        model = model.to(device)
        edited, found[part.name] = edit(part.name, model, surfels_of(part, entry, masks, model))
        path = write_texture(output / part.file, edited, {"part": part.name})
        models = {**scene.models, part.model: with_texture_of(part, entry, path)}
        scene = replace(scene, models=models)
    return scene, found


def surfels_of(part: Part, entry: SceneModel, masks: Sequence[Tensor], model: Surfels) -> Tensor | None:
    """Surfels [N] bool of a part, those of no segment for a model that has some; None for all of them.

    Raises:
        ArgumentError: if there is none.
    """
    if not masks:
        return None
    labels = labels_of(masks, len(model)).to(model.parameters["means"].device)
    number = 0 if part.segment is None else 1 + list(entry.segments).index(part.segment)
    surfels = labels == number
    if not bool(surfels.any()):
        raise ArgumentError(
            f"edit.parts: expected surfels of {part.name}, got none, for (other) segments hold all of them; "
            "name other parts"
        )
    return surfels


def with_texture_of(part: Part, entry: SceneModel, path: Path) -> SceneModel:
    """The model's entry with a texture for one of its parts."""
    if part.segment is None:
        return replace(entry, texture=path)
    segment = replace(entry.segments[part.segment], texture=path)
    return replace(entry, segments={**entry.segments, part.segment: segment})
