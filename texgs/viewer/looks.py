"""New looks for parts of a scene, from a picture or an instruction: the methods `image` and `text`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from shutil import rmtree
from tempfile import TemporaryDirectory
from time import monotonic
from typing import Any

import torch

from texgs.config.edit import Edit
from texgs.core.checksum import digest
from texgs.core.errors import ArgumentError
from texgs.core.keys import typed
from texgs.core.lens import Lens
from texgs.core.names import part_file
from texgs.edit.method import method_of
from texgs.edit.task import EditedScene, Task
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.variants import write_texture
from texgs.models.weights import available
from texgs.scene.scene import Scene
from texgs.viewer.jobs import Jobs, Watch
from texgs.viewer.messages import Look
from texgs.viewer.styles import Styles
from texgs.volume.cameras import icosphere_of
from texgs.volume.view_set import View

LENS = Lens().square(400)  # of the views that parts learn from
VIEWS = 92
BETWEEN = 2.0  # seconds between textures on their way that are shown
KEPT = 20  # of those of each part, and of previews: frames may be on their way
# The first is taken whose weights are on this machine.
FULL = ("default", "patches")  # recipes for pictures
GUIDANCE = ("instruct_pix2pix", "filters")  # what edits views by an instruction


class OrbitTask(Task[Any]):
    """An edit that learns from new views around the scene, under its light: training views are not needed."""

    def training_views(self, model: str) -> Sequence[View]:
        """Return the cameras on a sphere; there are no images."""
        return [View(camera, Path(), self.scene.light) for camera in icosphere_of(VIEWS, LENS)]


class Looks:
    """Gives parts of a scene new textures.

    Args:
        jobs: where that is done.
        styles: pictures to choose from.
        device: that works.
    """

    def __init__(self, jobs: Jobs, styles: Styles, device: torch.device | str = "cpu") -> None:
        self._jobs, self._styles, self._device = jobs, styles, torch.device(device)
        self._folder = TemporaryDirectory(prefix="texgs-looks-")
        self._scratch = ScratchFolders(Path(self._folder.name))

    def edit_of(self, asked: Look) -> Any:
        """Return the edit, as conf/edit has it, with a recipe whose weights are on this machine."""
        if bool(asked.style) == bool(asked.instruction):
            raise ArgumentError("look: expected a picture or an instruction, got both or none")
        if asked.style:
            style = self._styles.source(asked.style)
            recipes = ("preview",) if asked.preview else FULL
            choices = [{"image": {"style": style, "recipe": recipe}} for recipe in recipes]
        else:
            said = asked.instruction
            choices = [{"text": {"instruction": said, "guidance": guidance}} for guidance in GUIDANCE]
        *others, last = (self._typed(asked, choice) for choice in choices)
        edit = next((each for each in others if has_weights(each)), last)
        method_of(edit).check(method_of(edit).of(edit))
        return edit

    async def make(
        self,
        scene: Scene,
        edit: Any,
        output: Path,
        watch: Watch,
        show: Callable[[str, Path], None],
    ) -> EditedScene:
        """The scene with new textures, written to a folder, which must not be there; what it showed is gone.

        Args:
            scene: as it is before.
            edit: see `edit_of`.
            output: folder.
            watch: of the job.
            show: is called in the job's thread with a part and the file of its texture on its way.
        """
        return await self._jobs.run(partial(self._make, scene, edit, output, show), watch)

    def preview_folder(self, page: int, parts: Sequence[str]) -> Path:
        """A new folder for a preview; removed when a page has many of the same parts, and in the end."""
        return self._scratch.new(f"preview-{page}-{digest(repr(parts))}")

    def close(self) -> None:
        """Remove what was not kept."""
        self._folder.cleanup()

    def _typed(self, asked: Look, choice: dict[str, Any]) -> Any:
        (method,) = choice
        edit = typed(Edit, {"name": method, "method": method})
        # What a page has written is taken as it is: a configuration would look for references in it.
        chosen = replace(getattr(edit, method), **choice[method])
        return replace(edit, parts=list(asked.parts), **{method: chosen})

    def _make(self, scene: Scene, edit: Any, output: Path, show: Callable[[str, Path], None]) -> EditedScene:
        method = method_of(edit)
        settings, preview = method.of(edit), ThrottledPreview(show, self._scratch)
        task = OrbitTask(settings, edit, scene, {}, output, self._device, 1, LENS, "look", show=preview)
        is_alone = not output.parent.exists()
        try:
            output.mkdir(parents=True)
        except OSError as error:
            raise ArgumentError(
                f"{output}: cannot be written ({error.strerror}); start texgs view with another --folder"
            ) from error
        try:
            return method.run(task)
        except BaseException:
            rmtree(output)
            if is_alone:
                with suppress(OSError):  # others may be in it by now
                    output.parent.rmdir()
            raise


class ScratchFolders:
    """Folders with files that frames may be reading: when there are many of a kind, the oldest is removed.

    Args:
        parent: folder that they are in.
    """

    def __init__(self, parent: Path) -> None:
        self._parent, self._counts = parent, Counter[str]()

    def new(self, kind: str) -> Path:
        """Return a place for a folder."""
        self._counts[kind] += 1
        rmtree(self._parent / kind / f"{self._counts[kind] - KEPT}", ignore_errors=True)
        return self._parent / kind / f"{self._counts[kind]}"


class ThrottledPreview:
    """Parts on their way, of which some are written and shown.

    Args:
        show: is called with a part and the file of its texture.
        folders: for these files.
    """

    def __init__(self, show: Callable[[str, Path], None], folders: ScratchFolders) -> None:
        self._show, self._folders, self._latest = show, folders, monotonic()

    def __call__(self, part: str, model: Callable[[], Surfels]) -> None:
        """Show a part, unless one was shown a moment ago."""
        if monotonic() - self._latest < BETWEEN:
            return
        name = part_file("look", part)
        self._show(part, write_texture(self._folders.new(Path(name).stem) / name, model()))
        self._latest = monotonic()


def has_weights(edit: Any) -> bool:
    """Return whether all that an edit needs is on this machine."""
    return all(map(available, method_of(edit).weights(method_of(edit).of(edit))))
