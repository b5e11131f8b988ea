"""New looks for parts of a scene, from a picture or an instruction; and what they would be like."""

import io
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from shutil import rmtree
from time import monotonic
from typing import Any

import torch
from PIL import Image

from texgs.config.recipes import Edit
from texgs.core.errors import ArgumentError
from texgs.core.keys import typed
from texgs.core.names import part_file
from texgs.edit.method import method_of
from texgs.edit.readable import raise_opacities
from texgs.edit.task import EditedScene, OrbitTask, orbit_task, parts_with_surfels
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.variants import write_texture
from texgs.models.instruction import understand, vocabulary
from texgs.models.pictures import PICTURES
from texgs.models.weights import unusable
from texgs.scene.frame import frame
from texgs.scene.parts import NewLook, entry_of, look_of, with_looks
from texgs.scene.scene import Scene
from texgs.viewer.messages import Look, Orbit
from texgs.viewer.scratch import scratch_folder
from texgs.viewer.styles import MOST, Styles

QUICK = 352  # of those along the axes, which the scene fills
BETWEEN = 2.0  # seconds between textures on their way that are shown
KEPT = 20  # of those of each part, and of previews: frames may be on their way
THUMBNAILS = len(PICTURES) + 2 * MOST  # that are kept: of all pictures that there may be
THUMBNAIL = 112  # rows of pixels
# The first is taken whose weights are on this machine.
FULL = ("default", "patches")  # recipes for pictures
Show = Callable[[str, NewLook], None]  # of a part, and its look


class Looks:
    """Gives parts of a scene new textures."""

    def __init__(self, styles: Styles, device: torch.device | str = "cpu") -> None:
        self._styles, self._device = styles, torch.device(device)
        self._folder = scratch_folder()
        self._scratch = ScratchFolders(Path(self._folder.name))
        self._shown: dict[str, tuple[Scene | None, dict[str, NewLook]]] = {}  # by edit, of thumbnails
        self._latest: tuple[Any, Scene] | None = None  # scene, parts and opacity asked for, and its result

    def edit_of(self, asked: Look) -> Any:
        """Return the edit, as conf/edit has it, with a recipe whose weights are on this machine."""
        if bool(asked.style) == bool(asked.instruction):
            raise ArgumentError("look: expected a picture or an instruction, got both or none")
        choices: list[dict[str, Any]]
        if asked.style:
            style = self._styles.source(asked.style)
            recipes, start = ("preview",) if asked.preview else FULL, "sphere" if asked.sphere else None
            choices = [{"image": {"style": style, "recipe": recipe, "start": start}} for recipe in recipes]
        else:
            words = {"instruction": asked.instruction}
            quick = {**words, "guidance": "filters", "recipe": "quick", "size": QUICK}
            if asked.preview:
                choices = [{"text": {**quick, "views": "all" if asked.camera else None}}]
            else:
                choices = [{"text": words}, {"text": quick}]
        *others, last = (edit_with(asked.parts, choice) for choice in choices)
        edit = next((each for each in others if has_weights(each)), last)
        if edit is last and asked.instruction:
            require_known(asked.instruction)
        method_of(edit).of(edit).check()
        return edit

    def make(
        self, scene: Scene, edit: Any, output: Path, show: Show, side: Orbit | None = None
    ) -> EditedScene:
        """Return the scene with new textures, written to a folder, which must not be there.

        `show` is called with a part and its look on its way, whose file is gone in the end. With a side,
        views are one from there.
        """
        method = method_of(edit)
        task = orbit_task(scene, edit, output, self._device, (side.azimuth, side.polar) if side else None)
        task = self._raised(replace(task, draws=False))
        preview = ThrottledPreview(show, looks_of(task.scene, edit.parts, scene), self._scratch)
        is_alone = not output.parent.exists()
        try:
            output.mkdir(parents=True)
        except OSError as error:
            raise ArgumentError(
                f"{output}: cannot be written ({error.strerror}); start texgs view with another --folder"
            ) from error
        try:
            return method.run(replace(task, show=preview))
        except BaseException:
            rmtree(output)
            if is_alone:
                with suppress(OSError):  # others may be in it by now
                    output.parent.rmdir()
            raise

    def forget(self, page: int) -> None:
        """Remove the files of the previews of a page that is gone."""
        self._scratch.remove(f"preview-{page}")

    def _raised(self, task: OrbitTask) -> OrbitTask:
        """Return the task with opacities for its look; those of the latest scene are not measured again."""
        asked, latest = (task.scene, task.edit.parts, task.settings.factor), self._latest
        if latest is None or latest[0] != asked:  # another thread may put another one there
            self._latest = latest = (asked, raise_opacities(task).scene)
        return replace(task, scene=latest[1], settings=replace(task.settings, opacity="keep"))

    def preview(self, scene: Scene, asked: Look, page: int) -> dict[str, NewLook]:
        """Return looks as a page asks for, in files that stay until it has had many."""
        edit = with_parts(self.edit_of(asked), scene)
        output = self._scratch.new(f"preview-{page}", KEPT)
        known, looks = self._shown.get(repr(edit), (None, {}))
        if known == scene and (linked := linked_to(output, looks)):
            return linked
        edited = self.make(scene, edit, output, lambda *_: None, asked.camera)
        return looks_of(edited.scene, edit.parts, scene)

    def thumbnail(self, scene: Scene, asked: Look) -> bytes:
        """Return a small view of the scene with a look, from the camera that is asked for, as JPEG.

        A preview, and another camera, take next to no time from then on, unless many were made since.
        """
        if asked.camera is None:
            raise ArgumentError("camera: expected one to show a thumbnail from, got none")
        edit = with_parts(self.edit_of(asked), scene)
        known, looks = self._shown.get(repr(edit), (None, {}))
        if known != scene or not all(each.texture and each.texture.is_file() for each in looks.values()):
            output = self._scratch.new("thumbnail", THUMBNAILS)
            looks = looks_of(self.make(scene, edit, output, lambda *_: None).scene, edit.parts, scene)
            self._shown[repr(edit)] = (scene, looks)
        shown = with_looks(scene, looks)
        camera, file = asked.camera.camera(THUMBNAIL / asked.camera.height), io.BytesIO()
        Image.fromarray(frame(shown.open(self._device), camera, shown)).save(file, "JPEG", quality=90)
        return file.getvalue()

    def close(self) -> None:
        """Remove what was not kept."""
        self._folder.cleanup()


class ScratchFolders:
    """Folders with files that frames may be reading: when there are many of a kind, the oldest is removed."""

    def __init__(self, parent: Path) -> None:
        self._parent, self._counts = parent, Counter[str]()

    def new(self, kind: str, kept: int) -> Path:
        """Return a place for a folder, of which so many are kept."""
        self._counts[kind] += 1
        rmtree(self._parent / kind / f"{self._counts[kind] - kept}", ignore_errors=True)
        return self._parent / kind / f"{self._counts[kind]}"

    def remove(self, kind: str) -> None:
        """Remove all folders of a kind."""
        rmtree(self._parent / kind, ignore_errors=True)


class ThrottledPreview:
    """Parts on their way, of which some are written and shown with all else of their looks."""

    def __init__(self, show: Show, looks: Mapping[str, NewLook], folders: ScratchFolders) -> None:
        self._show, self._looks, self._folders, self._latest = show, looks, folders, monotonic()

    def __call__(self, part: str, model: Callable[[], Surfels]) -> None:
        """Show a part, unless one was shown a moment ago."""
        if monotonic() - self._latest < BETWEEN:
            return
        name = part_file("look", part)
        file = write_texture(self._folders.new(Path(name).stem, KEPT) / name, model())
        self._show(part, replace(self._looks[part], texture=file))
        self._latest = monotonic()


def with_parts(edit: Any, scene: Scene) -> Any:
    """Return the edit with the names of its parts, where these are all that have surfels."""
    return replace(edit, parts=edit.parts or parts_with_surfels(scene))


def looks_of(scene: Scene, parts: Sequence[str], before: Scene) -> dict[str, NewLook]:
    """Return the looks of parts, as far as they are other than what a new look begins with."""
    start = with_looks(before, {part: NewLook(entry_of(before, part).texture) for part in parts})
    return {part: look_of(scene, part, start) for part in parts}


def linked_to(folder: Path, looks: Mapping[str, NewLook]) -> dict[str, NewLook]:
    """Return looks with links in a new folder to their files, whatever becomes of these; or none."""
    linked = {}
    try:
        folder.mkdir(parents=True)
        for part, look in looks.items():
            if look.texture:
                linked[part] = replace(look, texture=folder / look.texture.name)
                (folder / look.texture.name).hardlink_to(look.texture)
    except OSError:  # a file is gone, or the system has no links
        rmtree(folder, ignore_errors=True)
        return {}
    return linked


def edit_with(parts: Sequence[str], choice: dict[str, Any]) -> Any:
    """Return the edit of parts by a method and the values of its settings."""
    ((method, values),) = choice.items()
    edit = typed(Edit, {"name": method, "method": method})
    # What a page has written is taken as it is: a configuration would look for references in it.
    chosen = replace(getattr(edit, method), **values)
    return replace(edit, parts=list(parts), **{method: chosen})


def require_known(instruction: str) -> None:
    """Require words that filters know."""
    try:
        understand(instruction)
    except ArgumentError as error:
        raise ArgumentError(
            f"{instruction!r}: expected what filters know ({', '.join(vocabulary())}), as previews and "
            "machines without the weights of InstructPix2Pix follow them"
        ) from error


def has_weights(edit: Any) -> bool:
    """Return whether all that an edit needs is on this machine."""
    return not any(map(unusable, method_of(edit).of(edit).weights()))
