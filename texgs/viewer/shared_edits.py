"""The one scene that all pages edit: steps with names, undo and redo, what is saved."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import count
from pathlib import Path
from typing import Any

from torch import Tensor

from texgs.core.errors import ArgumentError
from texgs.core.light import HEADLIGHT
from texgs.core.names import SCENES, file_name, new_part_file
from texgs.scene.parts import part_names, with_textures
from texgs.scene.scene import WHITE, Scene
from texgs.scene.scene_file import known, light_of, write_scene
from texgs.scene.session import Session, state_of
from texgs.viewer.messages import Edit, View
from texgs.viewer.opening import Opened, title_of
from texgs.viewer.segments import alone


class SharedEdits:
    """The scene that all pages edit, and where it is saved.

    Args:
        session: that is edited.
        opened: what it began with, and where scene files are written to.
    """

    def __init__(self, session: Session, opened: Opened) -> None:
        self._session, self._folder = session, opened.folder
        self.name, self._title = opened.name, opened.title
        files = [opened.file.resolve()] if opened.file else []
        self._own = {file: state_of(file) for file in files}  # replaced without a question, while they are so
        self.original = self._saved = session.scene
        self._latest: tuple[object, ...] | None = None  # author and number of a step that may go on

    @property
    def scene(self) -> Scene:
        """As it is now."""
        return self._session.scene

    def shown(self, view: View, trial: Mapping[str, Path | None] | None = None) -> Scene:
        """Return what a view shows.

        Args:
            view: of the scene, as it was opened, or of one model alone.
            trial: textures that parts have in the scene as it is now, as far as there are such parts.
        """
        if view.only:
            return alone(self.scene, view.only)
        if view.before:
            return self.original
        names, textures = part_names(self.scene), trial or {}
        tried = {part: textures[part] for part in names if part in textures}
        return with_textures(self.scene, tried, own_colors=True)

    @property
    def is_saved(self) -> bool:
        """Whether a file holds the scene as it is now."""
        return self.scene == self._saved

    def state(self) -> dict[str, Any]:
        """Return what pages show of the history, JSON."""
        return {
            "past": self._session.past,
            "future": self._session.future,
            "saved": self.is_saved,
            "file": self.name,
            "folder": str(self._folder.resolve()),
            "title": self._title,
        }

    def edit(self, edit: Edit, author: int) -> None:
        """Make a change; edits with the same number by the same author are one step."""
        step = (author, edit.step, edit.part, edit.key) if edit.step else None
        goes_on = step is not None and step == self._latest and self._session.undo()
        try:
            self._change(edit)
        except Exception:
            if goes_on:
                self._session.redo()
            raise
        self._step(edit.title)
        self._latest = step

    def make_segment(self, part: str, mask: Tensor, facts: Mapping[str, Any]) -> None:
        """Write the file of a new segment, and add it."""
        file = new_part_file("segment", self._folder, Path(self.name).stem, part)
        self._session.make_segment(part, mask, file, facts)
        self._step(f"{part} new")

    def give_textures(self, textures: Mapping[str, Path | None], look: str) -> None:
        """Give parts the textures of a new look, and back the palettes that these were made for."""
        self._session.set_textures(textures, own_colors=True)
        self._step(f"{', '.join(textures)} {look}")

    def rename_segment(self, part: str, name: str) -> None:
        """Give a segment another name."""
        before = self.scene
        self._session.rename_segment(part, name)
        if self.scene is before:
            return
        self._step(f"{part} renamed to {name}")

    def remove_segment(self, part: str) -> None:
        """Give the surfels of a segment back to its model; its file stays."""
        self._session.remove_segment(part)
        self._step(f"{part} removed")

    def undo(self) -> None:
        """Take the latest step back, if there is one."""
        self._latest = None
        self._session.undo()

    def redo(self) -> None:
        """Make again what was taken back last, if there is anything."""
        self._latest = None
        self._session.redo()

    def path_of(self, name: str) -> Path:
        """Return the scene file of a name in the folder for saving."""
        if Path(file_name("save as", name)).suffix not in SCENES:
            raise ArgumentError(f"save as: expected a name that ends in .yaml, got {name}")
        return self._folder / name

    def would_replace(self, name: str) -> bool:
        """Return whether saving replaces a file that is neither opened nor saved here, or has changed."""
        path = self.path_of(name)
        return path.exists() and self._own.get(path.resolve()) != state_of(path.resolve())

    def save(self, name: str) -> Path:
        """Write the scene file in one step."""
        path, scene = self.path_of(name), self.scene
        write_scene(path, scene)
        self.name, self._title, self._saved = name, title_of(path), scene
        self._own[path.resolve()] = state_of(path.resolve())
        return path

    def _step(self, name: str) -> None:
        self._session.name_step(name)
        self._latest = None

    def new_folder(self, kind: str) -> Path:
        """Return a folder for the files of a new look that is not there yet."""
        stem = Path(self.name).stem
        folders = (self._folder / f"{stem}-{kind}-{number}" for number in count(1))
        return next(folder for folder in folders if not folder.exists())

    def _change(self, edit: Edit) -> None:
        session, value = self._session, edit.value
        if edit.part:
            session.reset(edit.part, edit.key) if value is None else session.set(edit.part, edit.key, value)
            return
        known({edit.key: value}, ("light", "background"), "the scene")
        if edit.key == "background":
            session.set_background(WHITE if value is None else value)
        else:
            session.set_light(HEADLIGHT if value is None else light_of(value))
