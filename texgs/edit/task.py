"""What a method of editing gets, and what it gives."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Generic, TypeVar

import torch
from torch import Tensor

from texgs.core.errors import ArgumentError
from texgs.core.lens import Lens
from texgs.edit.keys import EditKeys
from texgs.edit.method import method_of
from texgs.edit.parts import edit_fields, edit_parts
from texgs.fields.field import Field
from texgs.fields.surfels.model import Surfels
from texgs.scene.scene import Scene
from texgs.volume.view_set import View, read_views

Settings = TypeVar("Settings")


def ignore(name: str, model: Callable[[], Surfels]) -> None:
    """Show nobody."""


@dataclass(frozen=True, eq=False)
class Task(Generic[Settings]):
    """One edit of one scene."""

    settings: Settings  # of the method
    edit: EditKeys  # what all methods have
    scene: Scene
    views: Mapping[str, Path]  # transforms_train.json of the training views, by model
    output: Path  # folder for textures, segments and pictures
    device: torch.device
    reduce: int  # factor by which the views were made smaller for the fit
    lens: Lens  # of the views, but for the size of images
    title: str  # of progress bars
    followed: Mapping[str, str] = field(default_factory=dict)  # by model, where not as settings say
    show: Callable[[str, Callable[[], Surfels]], None] = ignore  # is offered parts on their way

    def settings_for(self, model: str) -> Settings:
        """Settings with the picture or the instruction that a model follows."""
        method = method_of(self.edit)
        look = self.followed.get(model)
        return self.settings if look is None else replace(self.settings, **{method.follows: look})  # type: ignore[type-var]

    def training_views(self, model: str) -> Sequence[View]:
        """Training views of a model.

        Raises:
            ArgumentError: if the model is none of the data set's.
        """
        if model not in self.views:
            raise ArgumentError(
                f"scene: expected models named after basic TFs of the data set ({', '.join(self.views)}), "
                f"got {model}"
            )
        return read_views(self.views[model].parent).train

    def each_part(self, one: Callable[[str, Surfels, Tensor | None, Sequence[View]], Surfels]) -> Scene:
        """Edit the parts one after the other; the scene with their new textures, which are written.

        Args:
            one: from the name of a part, its model with the textures that it has, the surfels that may change
                (None: all) and training views, to the edited model.
        """
        return edit_parts(
            *(self.scene, self.edit.parts, self.output, self.device),
            lambda part, model, surfels: one(part.name, model, surfels, self.training_views(part.model)),
        )

    def each_model(self, one: Callable[[str, Field, Sequence[View]], Field]) -> Scene:
        """Edit whole models of any kind one after the other; the scene with the new ones, which are written.

        Args:
            one: from the name of a model, the model and training views, to the edited model.
        """
        return edit_fields(
            *(self.scene, self.edit.parts, self.output, self.device),
            lambda name, model: one(name, model, self.training_views(name)),
        )


@dataclass(frozen=True, eq=False)
class EditedScene:
    """A scene with a new look or a new part."""

    scene: Scene
    how: str  # what the method worked with, in tables
    pictures: Mapping[str, str] = field(default_factory=dict)  # what files of the output show, by their names
    lambda_s: float | None = None  # share of NNFM against CLIP
    notes: Mapping[str, Any] = field(default_factory=dict)  # what else there is to tell: no table reads it
    losses: Mapping[str, Mapping[str, Sequence[float]]] = field(default_factory=dict)  # by part and term
