"""A new look for parts of a scene from a picture or an instruction, without training views."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from shutil import rmtree
from typing import Any

import torch

from texgs.core.camera import Camera, orbit
from texgs.core.errors import ArgumentError, errors_at
from texgs.core.keys import typed_argument
from texgs.core.progress import let_stop
from texgs.edit.keys import EditKeys
from texgs.edit.method import MethodKeys, methods
from texgs.edit.readable import raise_opacities
from texgs.edit.task import Task, parts_of, run_method
from texgs.fields.surfels.model import Surfels
from texgs.scene.parts import NewLook, entry_of, look_of, part_names, with_looks
from texgs.scene.scene import Scene
from texgs.scene.session import Session
from texgs.volume.cameras import icosphere_of
from texgs.volume.view_set import View

VIEWS, SIDE = 92, 400  # number of views around the scene, and pixels of their sides
Show = Callable[[str, NewLook, Callable[[], Surfels]], None]  # a part, its look without texture, its model


@dataclass(frozen=True, eq=False, kw_only=True)
class LookTask(Task[Any]):
    """An edit that learns from new views around the scene, under its light: training views are not needed."""

    before: Scene  # the scene to change, before opacities are raised
    side: tuple[float, float] | None = None  # azimuth and polar angle of the only view; None: all sides

    def training_views(self, model: str) -> Sequence[View]:
        """Return the cameras on a sphere; there are no images."""
        return [View(camera, Path(), self.scene.light) for camera in self._cameras]

    @cached_property
    def _cameras(self) -> list[Camera]:
        """Return the cameras, the same for all parts."""
        if self.side:
            azimuth, polar = self.side
            return [orbit(azimuth, polar, *self.lens)]
        return icosphere_of(VIEWS, self.lens)


@dataclass(frozen=True, eq=False)
class LearnedLook:
    """The looks that an edit gives to parts."""

    looks: Mapping[str, NewLook]  # by part
    how: str  # what the method worked with
    gone: Sequence[str] = ()  # parts no longer in the scene


def settings_of(method: str, values: Mapping[str, Any]) -> MethodKeys:
    """Return the settings of a method from values by key.

    Raises:
        ArgumentError: for an unknown key, or a value of another type or out of range.
    """
    return typed_argument(methods()[method].settings, values, method)


def look_task(
    scene: Scene,
    settings: MethodKeys,
    parts: Iterable[str],
    output: Path,
    device: torch.device,
    side: tuple[float, float] | None = None,
) -> LookTask:
    """Return the task of giving parts a look by the settings of a method.

    Args:
        scene: before the edit.
        settings: of a method, checked here.
        parts: names; none: all models, with their segments unchanged.
        output: a new folder for files of the look.
        device: to learn on.
        side: azimuth and polar angle in degrees of the only view; None: views from all sides.
    """
    settings.check()
    name = settings.node.partition(".")[2]
    edit = EditKeys(name, name, parts=parts_of(scene, [*parts]))
    lens = scene.framed().lens().square(SIDE)
    return LookTask(
        settings, edit, scene, {}, output, device, 1, lens, "look", draws=False, before=scene, side=side
    )


def readable_task(task: LookTask) -> LookTask:
    """Raise the opacities in the task's scene permanently, so that the look can be seen."""
    task = raise_opacities(task)
    return replace(task, settings=replace(task.settings, opacity="keep"))


def learn_look(task: LookTask, show: Show | None = None) -> LearnedLook:
    """Return what a task, see `readable_task`, makes of its parts; `show` gets parts on their way.

    Files of the look are written to the task's folder, which must not be there; none stays if it fails.
    """
    is_alone, output = not task.output.parent.exists(), task.output
    if show is not None:
        looks = looks_between(task.before, task.scene, task.edit.parts)
        task = replace(task, show=lambda part, model: show(part, looks[part], model))
    try:
        output.mkdir(parents=True)
    except OSError as error:
        raise ArgumentError(
            f"{output}: cannot be written ({error.strerror}); choose another folder"
        ) from error
    try:
        edited = run_method(methods()[task.edit.method], task)
        let_stop(task.title)
    except BaseException:
        rmtree(output)
        if is_alone:
            with suppress(OSError):  # others may be in it by now
                output.parent.rmdir()
        raise
    return LearnedLook(looks_between(task.before, edited.scene, task.edit.parts), edited.how)


def give_look(session: Session, task: LookTask, title: str, show: Show | None = None) -> LearnedLook:
    """Learn the look of a task, and give it to the parts in one step of the session with a title.

    Parts that are gone by then are left out, and listed. Palettes go back to those that texels are made for.
    """
    learned = learn_look(readable_task(task), show)
    with errors_at(f"textures are in {task.output}"), session.lock:
        names = part_names(session.scene)
        there = {part: look for part, look in learned.looks.items() if part in names}
        with session.one_step(f"{', '.join(there)} {title}"):
            if there:
                session.set_looks(there)
    return replace(learned, gone=[part for part in learned.looks if part not in names])


def looks_between(before: Scene, after: Scene, parts: Iterable[str]) -> dict[str, NewLook]:
    """Return the looks of parts after an edit, as far as they differ from a plain new look."""
    start = with_looks(before, {part: NewLook(entry_of(before, part).texture) for part in parts})
    return {part: look_of(after, part, start) for part in parts}
