"""Parts of a scene by name: MODEL, its surfels outside all segments, and MODEL/SEGMENT."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from texgs.core.errors import ArgumentError
from texgs.fields.part_edit import PartEdit
from texgs.scene.scene import Scene, SceneModel, SceneSegment

Entry = SceneModel | SceneSegment


def part_names(scene: Scene) -> list[str]:
    """Return the names of all parts: models and their segments."""
    segments = [f"{model}/{name}" for model, entry in scene.models.items() for name in entry.segments]
    return [*scene.models, *segments]


def split(scene: Scene, part: str) -> tuple[str, str | None]:
    """Return the model and segment of a part; the segment may be a new one.

    Names of models may contain the slash, names of segments may not.
    """
    if part in scene.models:
        return part, None
    model, _, segment = part.rpartition("/")
    if model not in scene.models:
        expected = ", ".join(scene.models)
        raise ArgumentError(f"expected a model of the scene ({expected}), got {model or part}")
    return model, segment


def entry_of(scene: Scene, part: str) -> Entry:
    """Return a model or segment by name."""
    model, segment = split(scene, part)
    if segment is None:
        return scene.models[model]
    segments = scene.models[model].segments
    if segment not in segments:
        raise ArgumentError(
            f"expected a segment of {model} ({', '.join(segments) or 'it has none'}), got {segment}"
        )
    return segments[segment]


def replace_entry(scene: Scene, part: str, entry: Entry | None) -> Scene:
    """Replace a model or segment of the scene by name; None removes a segment."""
    model, segment = split(scene, part)
    if segment is not None:
        if entry is None:
            entry_of(scene, part)
        segments = {**scene.models[model].segments, segment: entry}
        kept = {name: each for name, each in segments.items() if isinstance(each, SceneSegment)}
        entry = replace(scene.models[model], segments=kept)
    if not isinstance(entry, SceneModel):
        raise ArgumentError(f"expected a segment to remove, got the model {part}")
    return replace(scene, models={**scene.models, model: entry})


HIGHLIGHTS = ("specular", "shininess", "tint")  # values of a `PartEdit` for highlights


@dataclass(frozen=True)
class NewLook:
    """Changes to a part by a new look."""

    texture: Path | None  # file; None: the fitted texture
    edit: Mapping[str, Any] = field(default_factory=dict)  # values of a `PartEdit`


def with_looks(scene: Scene, looks: Mapping[str, NewLook]) -> Scene:
    """Give new looks to some parts of a scene.

    Their palettes go back to the fitted ones, which texels were made for. Where a part had another look
    already, its highlights go back, too: they may be those of the material that this look was.
    """
    for part, look in looks.items():
        entry = entry_of(scene, part)
        taken_back = ("palette", *HIGHLIGHTS) if entry.texture else ("palette",)
        edit = replace(entry.edit, **{key: getattr(PartEdit, key) for key in taken_back} | {**look.edit})
        scene = replace_entry(scene, part, replace(entry, texture=look.texture, edit=edit))
    return scene


def look_of(scene: Scene, part: str, before: Scene) -> NewLook:
    """Return the look of a part as far as it differs from another scene's."""
    entry, old = entry_of(scene, part), vars(entry_of(before, part).edit)
    return NewLook(entry.texture, {key: x for key, x in vars(entry.edit).items() if x != old[key]})


def key_path(part: str) -> str:
    """Return the path of a part's keys in a scene file."""
    model, slash, segment = part.rpartition("/")
    return f"models.{model}.segments.{segment}" if slash else f"models.{part}"


def require_new(scene: Scene, part: str) -> None:
    """Require that the model has no such segment yet."""
    model, segment = split(scene, part)
    if segment in scene.models[model].segments:
        raise ArgumentError(
            f"{part}: is there already; choose another name, or remove it by texgs edit {part}="
        )
