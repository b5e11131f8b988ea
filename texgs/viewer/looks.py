"""Looks for pages: their recipes, previews and thumbnails, and textures on their way."""

import io
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace
from itertools import count
from pathlib import Path
from shutil import rmtree
from time import monotonic
from typing import Any
from weakref import finalize

import torch
from PIL import Image

from texgs.core.errors import ArgumentError
from texgs.core.names import part_file
from texgs.edit.method import MethodKeys
from texgs.edit.new_look import (
    LearnedLook,
    LookTask,
    give_look,
    learn_look,
    look_task,
    readable_task,
    settings_of,
)
from texgs.edit.task import parts_with_surfels
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.variants import write_texture
from texgs.models.instruction import understand, vocabulary
from texgs.models.pictures import PICTURES
from texgs.models.weights import missing_advice
from texgs.scene.frame import frame
from texgs.scene.parts import NewLook, with_looks
from texgs.scene.scene import Scene
from texgs.scene.session import Session
from texgs.viewer.messages import Look
from texgs.viewer.styles import MOST_PICTURES, Styles

QUICK_SIZE = 352  # pixels of the views along the axes, which the scene fills
SECONDS_BETWEEN = 2.0  # at least, from one texture on its way to the next
MOST_TRIED = len(PICTURES) + 2 * MOST_PICTURES  # looks that are kept: one for each picture that there may be
THUMBNAIL_ROWS = 112
TryOn = Callable[[str, NewLook], object]  # a part, and its look on its way
FULL_RECIPES = ("default", "patches")  # for pictures: the first one counts whose weights are here


class TriedLook:
    """A look of a scene. Its files stay as long as this object."""

    def __init__(self, scene: Scene, learned: LearnedLook, folder: Path) -> None:
        self.scene, self.looks = scene, learned.looks
        finalize(self, rmtree, folder, ignore_errors=True)


class Looks:
    """Learns looks for pages, and keeps those that were tried last.

    A thumbnail is drawn from each new camera, and a preview takes the look that its thumbnail had. A picture
    takes 2 s for two models on a core, of which opacities, which depend on the scene alone, take half.
    """

    def __init__(self, styles: Styles, scratch: Path, device: torch.device | str = "cpu") -> None:
        self._styles, self._device = styles, torch.device(device)
        self._scratch, self._numbers = scratch, count()  # of folders in it
        self._tried = OrderedDict[str, TriedLook]()  # by request
        self._latest: tuple[Any, LookTask] | None = None  # what opacities depend on, and a task with them

    def give(self, session: Session, asked: Look, output: Path, show: TryOn) -> LearnedLook:
        """Give parts of the scene a look, whose files are written to a new folder.

        `show` is called now and then with a part and its look on its way, whose file is gone in the end.
        """
        task, on_their_way = self._task(session.scene, asked, output), self._new_folder()
        try:
            title = (asked.style or asked.instruction) + (f", hue {asked.hue:.3g}" if asked.hue < 1 else "")
            return give_look(session, task, title, Throttled(show, on_their_way))
        finally:
            rmtree(on_their_way, ignore_errors=True)

    def tried(self, scene: Scene, asked: Look) -> TriedLook:
        """Return a look to try, learned from the side of the request's camera, if it has one."""
        task = self._task(scene, asked, self._new_folder())
        key = repr((task.settings, task.edit.parts, task.side))
        known = self._tried.pop(key, None)
        if known is None or known.scene != scene:
            known = TriedLook(scene, learn_look(self._opaque(task)), task.output)
        self._tried[key] = known
        while len(self._tried) > MOST_TRIED:
            self._tried.popitem(last=False)
        return known

    def thumbnail(self, scene: Scene, asked: Look) -> bytes:
        """Return a small view of the scene with a look from the request's camera, as JPEG."""
        if asked.camera is None:
            raise ArgumentError("camera: expected one to show a thumbnail from, got none")
        tried = self.tried(scene, replace(asked, camera=None))
        shown, file = with_looks(scene, tried.looks), io.BytesIO()
        camera = asked.camera.camera(THUMBNAIL_ROWS / asked.camera.height)
        shown = replace(shown, light=shown.light.unhidden)  # its volume would have to be read first
        Image.fromarray(frame(shown.open(self._device), camera, shown)).save(file, "JPEG", quality=90)
        return file.getvalue()

    def _new_folder(self) -> Path:
        """Return a new folder for files."""
        return self._scratch / str(next(self._numbers))

    def _task(self, scene: Scene, asked: Look, output: Path) -> LookTask:
        """Return the task of a look, by a recipe whose weights are on this machine."""
        settings, side = self.recipe_of(asked), asked.camera
        parts = asked.parts or parts_with_surfels(scene)
        seen = (side.azimuth, side.polar) if side and asked.preview else None
        return look_task(scene, settings, parts, output, self._device, seen)

    def recipe_of(self, asked: Look) -> MethodKeys:
        """Return the settings of the edit: the first choice that has its weights, or the last one."""
        if bool(asked.style) == bool(asked.instruction):
            raise ArgumentError("look: expected a picture or an instruction, got both or none")
        if asked.style:
            picture: dict[str, Any] = {
                "style": self._styles.source(asked.style),
                "start": "sphere" if asked.sphere else None,
                "hue": asked.hue,
            }
            recipes = ("preview",) if asked.preview else FULL_RECIPES
            choices = [settings_of("image", {**picture, "recipe": recipe}) for recipe in recipes]
        else:
            words: dict[str, Any] = {"instruction": asked.instruction, "hue": asked.hue}
            quick = {**words, "guidance": "filters", "recipe": "quick", "size": QUICK_SIZE}
            if asked.preview:
                quick["views"] = "all" if asked.camera else None
            choices = [settings_of("text", each) for each in ([quick] if asked.preview else [words, quick])]
        *others, last = choices
        settings = next((each for each in others if not any(map(missing_advice, each.weights()))), last)
        if settings is last and asked.instruction:
            require_known(asked.instruction)
        return settings

    def _opaque(self, task: LookTask) -> LookTask:
        """Return the task with opacities for its look, measured once for a scene."""
        depends, latest = (task.scene, task.edit.parts, task.settings.factor), self._latest
        if latest is None or latest[0] != depends:  # another thread may replace it
            self._latest = latest = (depends, readable_task(task))
        return replace(task, scene=latest[1].scene, settings=replace(task.settings, opacity="keep"))


class Throttled:
    """Writes and shows a part on its way now and then."""

    def __init__(self, show: TryOn, folder: Path) -> None:
        self._show, self._folder, self._latest = show, folder, monotonic()

    def __call__(self, part: str, look: NewLook, model: Callable[[], Surfels]) -> None:
        """Show a part, unless the last one was a moment ago."""
        if monotonic() - self._latest >= SECONDS_BETWEEN:
            file = write_texture(self._folder / part_file("look", part), model())
            self._show(part, replace(look, texture=file))
            self._latest = monotonic()


def require_known(instruction: str) -> None:
    """Require words that filters know."""
    try:
        understand(instruction)
    except ArgumentError as error:
        raise ArgumentError(
            f"{instruction!r}: expected what filters know ({', '.join(vocabulary())}), as previews and "
            "machines without the weights of InstructPix2Pix follow them"
        ) from error
