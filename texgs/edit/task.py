"""Input and output of a method of editing, and how it edits parts of a scene: models or segments."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Generic, TypeVar

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError, ConfigError
from texgs.core.lens import Lens
from texgs.core.names import part_files
from texgs.edit.hue import HueBound
from texgs.edit.keys import EditKeys
from texgs.edit.method import Method, method_of
from texgs.fields.field import Field
from texgs.fields.kinds import kinds
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.variants import labels_of, write_texture
from texgs.scene.parts import NewLook, entry_of, part_names, replace_entry, split, with_looks
from texgs.scene.scene import Scene
from texgs.volume.images import smaller
from texgs.volume.view_set import View, read_views

Settings = TypeVar("Settings")
SERIES_STEPS = 6  # time steps, at most, that a look learns from besides the scene's own


def parts_of(scene: Scene, names: Sequence[str]) -> list[str]:
    """Return the parts to edit by name, MODEL or MODEL/SEGMENT; by default all models."""
    known = part_names(scene)
    for name in names:
        if name not in known:
            raise ArgumentError(f"edit.parts: expected some of {', '.join(known)}, got {name}")
        if names.count(name) > 1:
            raise ArgumentError(f"edit.parts: expected different names, got {name} twice")
    return list(names) or list(scene.models)


def parts_with_surfels(scene: Scene) -> list[str]:
    """Return the names of all parts that have surfels outside of other parts."""
    names = []
    for name, entry in scene.models.items():
        own = [name, *(f"{name}/{segment}" for segment in entry.segments)]
        if entry.segments:
            model, masks = entry.surfels()
            labels = set(labels_of(masks, len(model)).unique().tolist())
            own = [part for number, part in enumerate(own) if number in labels]
        names += own
    return names


def surfels_of(scene: Scene, part: str) -> tuple[Surfels, Tensor | None]:
    """Return the model of a part with its textures, and the mask [N] of the part's surfels.

    For a model, these are the surfels outside all segments; None stands for all surfels.
    """
    name, segment = split(scene, part)
    entry = scene.models[name]
    model, masks = entry.surfels()
    if not masks:
        return model, None
    number = 0 if segment is None else 1 + list(entry.segments).index(segment)
    surfels = labels_of(masks, len(model)) == number
    if not bool(surfels.any()):
        raise ArgumentError(
            f"edit.parts: expected surfels of {part}, got none, for (other) segments hold all of them; "
            "name other parts"
        )
    return model, surfels


@dataclass(frozen=True, eq=False)
class Task(Generic[Settings]):
    """One edit of one scene."""

    settings: Settings  # of the method
    edit: EditKeys  # keys common to all methods
    scene: Scene
    views: Mapping[str, Path]  # transforms_train.json of the training views, by model
    output: Path  # folder for textures, segments and pictures
    device: torch.device
    reduce: int  # factor by which the views were made smaller for the fit
    lens: Lens  # of the views, except for the image size
    title: str  # of progress bars
    followed: Mapping[str, str] = field(default_factory=dict)  # by model; overrides the settings
    show: Callable[[str, Callable[[], Surfels]], None] = lambda part, model: None  # shows progress
    draws: bool = True  # whether to draw pictures of an instruction's views, which takes seconds

    def settings_for(self, part: str) -> Settings:
        """Return the settings with the picture or instruction for the model of a part."""
        followed = self.followed.get(split(self.scene, part)[0])
        changes: dict[str, Any] = {} if followed is None else {method_of(self.edit).follows: followed}
        return replace(self.settings, **changes)  # type: ignore[type-var]

    def opacity_of(self, part: str) -> float:
        """Return the scene's factor on the opacity of a part; 1 for a part that it fades away."""
        return entry_of(self.scene, part).edit.opacity or 1.0

    def hue_of(self, part: str, surfels: Tensor | None) -> HueBound | None:
        """Return the bound on the hue of a part's look, of which surfels [N] change; None: any hue."""
        share: float = self.settings.hue  # type: ignore[attr-defined]
        if share == 1:
            return None
        fitted = self.scene.as_fitted.models.items()
        models = {name: each.surfels()[0].to(self.device) for name, each in fitted}
        return HueBound.of(models, split(self.scene, part)[0], surfels, share)

    def title_of(self, part: str) -> str:
        """Return the title of a progress bar."""
        return f"{self.title} {self.edit.name}, {part}"

    def training_views(self, model: str) -> Sequence[View]:
        """Return the training views of a model."""
        if model not in self.views:
            raise ArgumentError(
                f"scene: expected models named after basic TFs of the data set ({', '.join(self.views)}), "
                f"got {model}"
            )
        return read_views(self.views[model].parent).train

    def cameras_of(self, views: Sequence[View]) -> list[Camera]:
        """Return the cameras of views as small as they were for the fit, on the task's device."""
        return [smaller(view.camera, self.reduce).to(self.device) for view in views]

    def other_steps(self, part: str) -> list[Surfels]:
        """Return the model of a part at further steps of its series, so that the look suits all steps."""
        name, _ = split(self.scene, part)
        if self.scene.series is None or name not in self.scene.series.models:
            return []
        last = len(self.scene.series.steps) - 1
        spread = {round(last * i / (SERIES_STEPS - 1)) for i in range(SERIES_STEPS)} - {self.scene.time}
        return [self.scene.at(step).models[name].surfels()[0].to(self.device) for step in sorted(spread)]

    def each_part(
        self,
        one: Callable[[str, Surfels, Tensor | None, Sequence[View]], Surfels],
        values: Callable[[str, Surfels, Tensor | None], Mapping[str, Any]] = lambda *part: {},
    ) -> Scene:
        """Edit the parts one after the other, each alone, and return the scene with their new looks.

        Edited palettes are reset, because they belonged to other texels. `one` maps a part's name, its model
        with textures, the surfels that may change (None: all) and training views to the edited model;
        `values` of the part's `PartEdit` may depend on this model.
        """
        scene = self.scene
        for part, name in part_files("edit.parts", parts_of(scene, self.edit.parts)).items():
            file = self.output / name
            model, surfels = surfels_of(scene, part)
            surfels = None if surfels is None else surfels.to(self.device)
            edited = one(part, model.to(self.device), surfels, self.training_views(split(scene, part)[0]))
            if not isinstance(edited, Surfels):
                got = type(edited).__name__
                raise ConfigError(f"method {self.edit.method}: expected Surfels of each_part, got {got}")
            path = write_texture(file, edited, {"part": part})
            scene = with_looks(scene, {part: NewLook(path, values(part, edited, surfels))})
        return scene

    def each_model(self, one: Callable[[str, Field, Sequence[View]], Field]) -> Scene:
        """Edit whole models of any kind one after the other, each alone, and return the scene with them."""
        scene = self.scene
        for name, file_name in part_files("edit.parts", parts_of(scene, self.edit.parts)).items():
            entry, file = scene.models[split(scene, name)[0]], self.output / file_name
            edited = one(name, entry.open()[0].to(self.device), self.training_views(name))
            scene = replace_entry(scene, name, replace(entry, file=kinds()[edited.kind].write(file, edited)))
        return scene


@dataclass(frozen=True, eq=False)
class EditedScene:
    """A scene with a new look or a new part, and facts about the edit."""

    scene: Scene
    how: str  # means of the method, for tables
    pictures: Mapping[str, str] = field(default_factory=dict)  # captions by file name
    lambda_s: float | None = None  # share of NNFM against CLIP
    notes: Mapping[str, Any] = field(default_factory=dict)  # further facts; no table reads them
    losses: Mapping[str, Mapping[str, Sequence[float]]] = field(default_factory=dict)  # by part and term


def run_method(method: Method[Any], task: Task[Any]) -> EditedScene:
    """Run a method on a task, and require a scene as the result."""
    edited = method.run(task)
    if not isinstance(edited, EditedScene):
        raise ConfigError(f"method {method.name}: expected an EditedScene, got {type(edited).__name__}")
    return edited
