"""The one scene that all pages edit: where it comes from, its steps, and where it is saved."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

from texgs.core.errors import ArgumentError
from texgs.core.names import METRICS, SCENE, SCENES, file_name, new_part_file
from texgs.report.check import found_sentence
from texgs.scene.copied import require_files, write_copy
from texgs.scene.parts import NewLook, part_names, with_looks
from texgs.scene.scene import Scene
from texgs.scene.scene_file import read_scene, scene_path, title_of, write_scene
from texgs.scene.session import Session, files_of, state_of
from texgs.viewer.messages import Edit, Redo, Remove, Rename, Undo, View
from texgs.viewer.segments import isolated

LONGEST_TITLE = 300  # letters
Change = Edit | Undo | Redo | Rename | Remove


@dataclass(frozen=True)
class Opened:
    """A scene, and where its edits are saved."""

    scene: Scene
    source: Path  # of the scene
    folder: Path
    name: str  # of the scene file to save, by default
    file: Path | None = None  # the scene file that edits may replace
    title: str = ""  # on pages; default by the path
    copies: Path | None = None  # folder for copies of all files; default: save a scene file only


def open_scene(path: Path, folder: Path | None = None) -> Opened:
    """Return the scene of a path, see `read_scene`, and where it is saved.

    A scene that a job wrote is saved under another name in the current folder: jobs do not replace a folder
    that holds files of others.
    """
    path = scene_path(path)
    of_job = (path.parent / METRICS).exists()
    folder = folder or (Path.cwd() if of_job else path.parent)
    name, file = ("edited.yaml", None) if of_job and path.name == SCENE else (path.name, path)
    if path.suffix not in SCENES:
        name, file = SCENE, None
    return Opened(read_scene(path), path, folder, name, file)


class SharedEdits:
    """The scene that all pages edit, and where it is saved."""

    def __init__(self, session: Session, opened: Opened) -> None:
        self.session, self._folder, self._copies = session, opened.folder, opened.copies
        self.name, self._source = opened.name, opened.source
        self.title = opened.title or title_of(opened.source)
        files = [opened.file.resolve()] if opened.file else []
        self._own = {file: state_of(file) for file in files}  # may be replaced unasked in this state
        self.original = self._saved = session.scene
        # The author and the number of a step that may go on, and its scene.
        self._latest: tuple[tuple[object, ...] | None, Scene] = (None, session.scene)

    @property
    def scene(self) -> Scene:
        """Return the scene as it is now."""
        return self.session.scene

    def checked(self, scene: Scene) -> str:
        """Return the result of `texgs check` for the models of a scene; empty where there is none."""
        return found_sentence(self._source, scene)

    @property
    def is_saved(self) -> bool:
        """Return whether a file holds the scene as it is now."""
        return self.scene == self._saved

    def scene_of(self, view: View, trial: Mapping[str, NewLook] | None = None) -> Scene:
        """Return what a view shows: the scene now, as it was opened, at its step, or one model alone.

        The scene as it is now has the looks of a trial, as far as it has such parts.
        """
        if view.only:
            return isolated(self.scene, view.only)
        if view.before:
            time = self.scene.time
            return self.original if time is None else self.original.at(time)
        names, looks = part_names(self.scene), trial or {}
        return with_looks(self.scene, {part: looks[part] for part in names if part in looks})

    def state(self) -> dict[str, Any]:
        """Return the history as pages show it, JSON."""
        return {
            "past": self.session.past,
            "future": self.session.future,
            "saved": self.is_saved,
            "file": self.name,
            "folder": str((self._copies or self._folder).resolve()),
            "title": self.title,
        }

    def change(self, asked: Change, author: int) -> None:
        """Make a change; edits with the same number by the same author are one step."""
        session, step = self.session, None
        with session.lock:
            if isinstance(asked, Undo):
                session.undo()
                self._require_step(session.redo)
            elif isinstance(asked, Redo):
                session.redo()
                self._require_step(session.undo)
            elif isinstance(asked, Rename):
                with session.one_step(f"{asked.part} renamed to {asked.name}"):
                    session.rename_segment(asked.part, asked.name)
            elif isinstance(asked, Remove):
                with session.one_step(f"{asked.part} removed"):
                    session.remove_segment(asked.part)
            else:
                step = (author, asked.step, asked.part, asked.key) if asked.step else None
                is_latest = self._latest[0] == step and self._latest[1] is self.scene
                goes_on = step is not None and is_latest and session.undo()
                try:
                    with session.one_step(asked.title[:LONGEST_TITLE]):
                        session.change(asked.part, asked.key, asked.value)
                except Exception:
                    if goes_on:
                        session.redo()
                    raise
            self._latest = step, self.scene

    def path_of(self, name: str) -> Path:
        """Return the scene file of a name in the folder for saving, or of a folder of that name there."""
        if Path(file_name("save as", name)).suffix not in SCENES:
            raise ArgumentError(f"save as: expected a name that ends in .yaml, got {name}")
        path = self._copies / Path(name).stem / SCENE if self._copies else self._folder / name
        if (path.parent / METRICS).exists():
            raise ArgumentError(
                f"save as: {path.parent} is a result of the workflow, which makes it anew; start the viewer "
                "in another folder, or with --folder"
            )
        return path

    def would_replace(self, name: str) -> bool:
        """Return whether saving would replace a file of others: one that was not opened or saved here."""
        path = self.path_of(name)
        return path.exists() and self._own.get(path.resolve()) != state_of(path.resolve())

    def save(self, name: str) -> Path:
        """Write the scene file in one step; require all files that it names."""
        path, scene = self.path_of(name), self.scene
        require_files(files_of(scene))
        path = write_copy(path.parent, scene) if self._copies else write_scene(path, scene)
        self.name, self.title, self._saved = name, title_of(path), scene
        self._own[path.resolve()] = state_of(path.resolve())
        return path

    def new_file(self, where: str, part: str) -> Path:
        """Return a free path for the file of a new part."""
        return new_part_file(where, self._folder, Path(self.name).stem, part)

    def new_folder(self, kind: str) -> Path:
        """Return a free path for the folder of a new look."""
        stem = Path(self.name).stem
        folders = (self._folder / f"{stem}-{kind}-{number}" for number in count(1))
        return next(folder for folder in folders if not folder.exists())

    def _require_step(self, take_back: Callable[[], object]) -> None:
        """Require all files of the scene; take the step back where one is missing."""
        try:
            require_files(files_of(self.scene))
        except ArgumentError:
            take_back()
            raise
