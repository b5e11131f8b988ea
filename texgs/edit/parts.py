"""Parts of a scene that an edit gives a new look: whole models, or segments of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import torch
from torch import Tensor

from texgs.core.errors import ArgumentError
from texgs.core.names import part_file
from texgs.fields.field import Field
from texgs.fields.kinds import kinds
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.variants import labels_of, write_texture
from texgs.scene.parts import replaced, with_textures
from texgs.scene.scene import Scene, SceneModel


@dataclass(frozen=True)
class ScenePart:
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


def parts_of(scene: Scene, names: Sequence[str]) -> list[ScenePart]:
    """The parts that have these names; all models by default.

    Raises:
        ArgumentError: naming the one that is not in the scene, or there twice.
    """
    known = [ScenePart(model) for model in scene.models]
    known += [
        ScenePart(model, segment) for model, entry in scene.models.items() for segment in entry.segments
    ]
    by_name = {part.name: part for part in known}
    for name in names:
        if name not in by_name:
            raise ArgumentError(f"edit.parts: expected some of {', '.join(by_name)}, got {name}")
        if names.count(name) > 1:
            raise ArgumentError(f"edit.parts: expected different names, got {name} twice")
    return [by_name[name] for name in names] or [ScenePart(model) for model in scene.models]


def parts_with_surfels(scene: Scene) -> list[str]:
    """Names of all models and segments, but for those whose surfels are all in (other) segments."""
    names = []
    for name, entry in scene.models.items():
        own = [name, *(f"{name}/{segment}" for segment in entry.segments)]
        if entry.segments:
            model, masks = entry.surfels()
            labels = set(labels_of(masks, len(model)).unique().tolist())
            own = [part for number, part in enumerate(own) if number in labels]
        names += own
    return names


def edit_parts(
    scene: Scene,
    names: Sequence[str],
    output: Path,
    device: torch.device,
    edit: Callable[[ScenePart, Surfels, Tensor | None], Surfels],
) -> Scene:
    """Edit parts one after the other, each alone, and write their textures.

    Args:
        scene: as it is before.
        names: of the parts; all models by default.
        output: folder of the files.
        device: that works.
        edit: from a part, its model with the textures that it has, and the surfels that may change (None:
            all), to the edited model.

    Returns:
        The scene with the new textures, without palettes that were edited before: these were of other texels.
    """
    for part in parts_of(scene, names):
        entry = scene.models[part.model]
        model, masks = entry.surfels()
        model = model.to(device)
        edited = edit(part, model, surfels_of(part, entry, masks, model))
        path = write_texture(output / part.file, edited, {"part": part.name})
        scene = with_textures(scene, {part.name: path}, own_colors=True)
    return scene


def edit_fields(
    scene: Scene,
    names: Sequence[str],
    output: Path,
    device: torch.device,
    edit: Callable[[str, Field], Field],
) -> Scene:
    """Edit whole models of any kind one after the other, each alone, and write them.

    Args:
        scene: as it is before.
        names: of the models; all by default.
        output: folder of the files.
        device: that works.
        edit: from the name of a model and the model, to the edited one.

    Returns:
        The scene with the new models.
    """
    for part in parts_of(scene, names):
        entry = scene.models[part.model]
        edited = edit(part.name, entry.open()[0].to(device))
        path = kinds()[edited.kind].write(output / part.file, edited)
        scene = replaced(scene, part.name, replace(entry, file=path))
    return scene


def surfels_of(part: ScenePart, entry: SceneModel, masks: Sequence[Tensor], model: Surfels) -> Tensor | None:
    """Surfels [N] bool of a part, those of no segment for a model that has some; None for all of them."""
    if not masks:
        return None
    labels = labels_of(masks, len(model)).to(model.device)
    number = 0 if part.segment is None else 1 + list(entry.segments).index(part.segment)
    surfels = labels == number
    if not bool(surfels.any()):
        raise ArgumentError(
            f"edit.parts: expected surfels of {part.name}, got none, for (other) segments hold all of them; "
            "name other parts"
        )
    return surfels
