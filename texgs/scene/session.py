"""A scene under edit: each change makes a new scene, and all changes can be undone."""

import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import wraps
from pathlib import Path
from threading import RLock
from typing import Any, Concatenate, ParamSpec, Self, TypeVar

import numpy as np
import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.colors import color
from texgs.core.cuts import Cuts
from texgs.core.errors import ArgumentError, errors_at
from texgs.core.keys import require_keys
from texgs.core.light import HEADLIGHT, HIDING, Light
from texgs.core.names import require_name
from texgs.fields.field import Composed
from texgs.fields.files import kind_of
from texgs.fields.part_edit import EDIT_KEYS, PartEdit, require_possible
from texgs.raster import Render
from texgs.scene.cut_view import scene_and_volume
from texgs.scene.exposure import require_shadows
from texgs.scene.frame import frame, point_at
from texgs.scene.legend import legend_of
from texgs.scene.marks import with_marks
from texgs.scene.parts import NewLook, entry_of, key_path, replace_entry, require_new, split, with_looks
from texgs.scene.scene import WHITE, Scene, SceneSegment
from texgs.scene.scene_file import cuts_of, functions_of, light_of, markers_of, read_scene, write_scene
from texgs.scene.segment_file import read_segment, write_segment
from texgs.scene.shot import Mode, Shot
from texgs.scene.twin import Twin, last_of, needs_twin
from texgs.volume.slice_keys import SliceKeys
from texgs.volume.slice_picture import slice_picture

T = TypeVar("T")
P = ParamSpec("P")
SCENE_KEYS: dict[str, Any] = {
    "light": "headlight",
    **{key: getattr(HEADLIGHT, key) for key in HIDING},
    "background": WHITE,
    "cuts": {},
    "functions": {},
    "markers": [],
    "time": 0,
}  # edits of a whole scene, with their defaults
HISTORY_STEPS = 200  # in the history; older ones cannot be undone
KEPT_COMPOSITIONS = 3  # compositions and twins, as pages may compare scenes before and after an edit


def locked(
    change: Callable[Concatenate["Session", P], T],
) -> Callable[Concatenate["Session", P], T]:
    """Make a method hold the lock of its session from its first read to its step."""

    @wraps(change)
    def run(session: "Session", /, *given: P.args, **named: P.kwargs) -> T:
        with session.lock:
            return change(session, *given, **named)

    return run


class Session:
    """A scene and its history. Parts have the names MODEL and MODEL/SEGMENT.

    What is edited by numbers (colours, opacities, light) costs nothing but the next frame: files are read
    again only where a change brings others. A change that cannot be made is an ArgumentError or a ShapeError
    that names the part, and leaves the scene as it is. Threads that share a session make their changes in
    turn; several changes that belong together are made in `one_step`.

    Args:
        scene: to begin with.
        device: that frames are rendered on.
    """

    def __init__(self, scene: Scene, device: torch.device | str = "cpu") -> None:
        self._past, self._future = [(scene, "")], list[tuple[Scene, str]]()  # with titles of steps
        self.lock = RLock()
        self.changed: Callable[[], object] = lambda: (
            None
        )  # is called after each step, and when one is taken back
        self._device = device
        self._opened = deque[tuple[object, Composed]](maxlen=KEPT_COMPOSITIONS)
        self._twins = deque[tuple[object, Twin]](maxlen=KEPT_COMPOSITIONS)

    @classmethod
    def open(cls, path: str | Path, device: torch.device | str = "cpu") -> Self:
        """Return a session that begins with a scene file; its models are read when a frame needs them."""
        return cls(read_scene(path), device)

    @property
    def scene(self) -> Scene:
        """Return the current scene."""
        return self._past[-1][0]

    @property
    def past(self) -> list[str]:
        """Return the titles of the steps, the oldest first; see `one_step`."""
        return [title for _, title in self._past[1:]]

    @property
    def future(self) -> list[str]:
        """Return the titles of undone steps, the latest first."""
        return [title for _, title in reversed(self._future)]

    # ---- Changes ------------------------------------------------------------

    @locked
    def set(self, part: str, key: str, value: Any) -> None:
        """Set a value of a part's edit: `visible`, `palette`, `opacity`, or a factor of the material."""
        entry = entry_of(self.scene, part)
        require_keys({key: value}, EDIT_KEYS, key_path(part))
        kind = kind_of(self.scene.models[split(self.scene, part)[0]].file)
        with errors_at(key_path(part), "."):
            require_possible(PartEdit(**{key: value}), kind.name)
            edit = replace(entry.edit, **{key: value})
        self._push(replace_entry(self.scene, part, replace(entry, edit=edit)))

    def reset(self, part: str, key: str) -> None:
        """Reset a value of a part's edit."""
        self.set(part, key, getattr(PartEdit(), key, None))

    def change(self, part: str, key: str, value: Any) -> None:
        """Set a value of a part, or of the scene where the part is empty. None takes the edit back."""
        if not part:
            self.set_of_scene(key, SCENE_KEYS.get(key) if value is None else value)
        elif value is None:
            self.reset(part, key)
        else:
            self.set(part, key, value)

    @locked
    def set_file(self, part: str, key: str, file: Path | None) -> None:
        """Give a part another `file` or `texture`; None: the fitted texels."""
        changed: dict[str, Any] = {key: file}
        scene = replace_entry(self.scene, part, replace(entry_of(self.scene, part), **changed))
        self._push_read(scene, {split(self.scene, part)[0]})

    @locked
    def set_looks(self, looks: Mapping[str, NewLook]) -> None:
        """Give several parts new looks in one step; see `with_looks` for palettes."""
        models = {split(self.scene, part)[0] for part in looks}
        self._push_read(with_looks(self.scene, looks), models)

    @locked
    def set_light(self, light: Light = HEADLIGHT) -> None:
        """Change the light of the scene, with its shadows."""
        before = self.scene.light
        if light.shadows > before.shadows or light.occlusion > before.occlusion:
            require_shadows(self.scene)
        self._push(replace(self.scene, light=light))

    @locked
    def set_cuts(self, cuts: Cuts) -> None:
        """Replace the cuts of the scene."""
        self._push(replace(self.scene, cuts=cuts))

    @locked
    def set_scene(self, scene: Scene) -> None:
        """Continue with another scene, after reading its models."""
        changed = [name for name, entry in scene.models.items() if self.scene.models.get(name) != entry]
        self._push_read(scene, changed)

    @locked
    def set_of_scene(self, key: str, value: Any) -> None:
        """Set an edit of the whole scene from a plain value; see `SCENE_KEYS`."""
        require_keys({key: value}, SCENE_KEYS, "the scene")
        match key:
            case "light":
                self.set_light(light_of(value, self.scene.light))
            case _ if key in HIDING:
                self.set_light(light_of({key: value}, self.scene.light))
            case "cuts":
                self.set_cuts(cuts_of(value))
            case "functions":
                self._push(replace(self.scene, functions=functions_of(value, key)))
            case "markers":
                self._push(replace(self.scene, markers=markers_of(value)))
            case "time":
                self.set_scene(self.scene.at(value))
            case _:
                self._push(replace(self.scene, background=color("background", value)))

    @locked
    def add_segment(self, part: str, file: Path) -> None:
        """Make surfels of a model, those of a file of `write_segment`, a part of their own.

        It looks as the rest of the model does. A part that is there gets other surfels.
        """
        model, name = split(self.scene, part)
        entry = self.scene.models[model]
        require_name(name, key_path(part))
        before = entry.segments.get(str(name), SceneSegment(file, entry.edit, entry.texture))
        self._push_read(replace_entry(self.scene, part, replace(before, file=file)), {model})

    @locked
    def make_segment(self, part: str, mask: Tensor, file: Path, facts: Mapping[str, Any]) -> None:
        """Write the file of a new segment, and add it.

        A file that is there is replaced, unless this scene or an earlier one has it: undo brings these back.

        Args:
            part: MODEL/SEGMENT, a new name.
            mask: [N] bool, surfels of the model, of which earlier segments have not all.
            file: target.
            facts: what the segment comes from, JSON.
        """
        require_new(self.scene, part)
        if file.resolve() in {each.resolve() for scene, _ in self._past for each in files_of(scene) if each}:
            raise ArgumentError(f"{part}: expected a new file, got {file} of an earlier scene; name another")
        name, mask = split(self.scene, part)[0], mask.cpu()
        entry = self.scene.models[name]
        fitted, free = replace(entry, texture=None, segments={}, step=None).surfels()[0], mask.clone()
        for other in entry.segments.values():
            free &= ~read_segment(other.file, fitted)
        if not bool(free.any()):
            raise ArgumentError(
                f"{part}: expected surfels that no segment of {name} has, got none; remove one that has them "
                f"({', '.join(entry.segments)})"
            )
        held, count = int((mask & ~free).sum()), int(mask.sum())
        note = f", of which {held} stay with earlier segments" if held else ""
        sys.stderr.write(f"{part}: {count} of {len(mask)} surfels{note}\n")
        write_segment(file, fitted, mask, facts)
        self.add_segment(part, file)

    @locked
    def remove_segment(self, part: str) -> None:
        """Remove a segment; its surfels return to their model."""
        self._push(replace_entry(self.scene, part, None))

    @locked
    def rename_segment(self, part: str, name: str) -> None:
        """Rename a segment; it keeps its place in the order of its model."""
        model, segment = split(self.scene, part)
        if segment is None:
            raise ArgumentError(f"expected a segment to rename, got the model {part}")
        entry_of(self.scene, part)
        require_name(name, key_path(part))
        if name == segment:
            return
        require_new(self.scene, f"{model}/{name}")
        entry = self.scene.models[model]
        names = {each: name if each == segment else each for each in entry.segments}
        renamed = replace(entry, segments={names[each]: value for each, value in entry.segments.items()})
        self._push(replace_entry(self.scene, model, renamed))

    @contextmanager
    def one_step(self, title: str = "") -> Iterator[None]:
        """Make all changes within the block one step with a title, or none if one of them fails.

        Threads enter such blocks in turn.
        """
        with self.lock:
            past, future = self._past, [*self._future]
            try:
                yield
            except BaseException:
                self._past, self._future = past, future
                raise
            if self.scene is not past[-1][0]:
                self._past = [*past[-HISTORY_STEPS:], (self.scene, title)]
        self.changed()

    @locked
    def undo(self) -> bool:
        """Undo the latest change; return whether there was one."""
        if len(self._past) == 1:
            return False
        self._future.append(self._past.pop())
        self.changed()
        return True

    @locked
    def redo(self) -> bool:
        """Redo the latest undone change; return whether there was one."""
        if not self._future:
            return False
        self._past.append(self._future.pop())
        self.changed()
        return True

    # ---- Views ------------------------------------------------------------

    @property
    def composition(self) -> Composed:
        """Return the models of the scene, joined; kept as long as their files are the same."""
        return self.composition_of(self.scene)

    def frame(
        self,
        camera: Camera,
        mode: Mode = "shaded",
        scene: Scene | None = None,
        step: float | None = None,
        *,
        transparent: bool = False,
    ) -> np.ndarray:
        """Return one frame [H, W, 3 or 4], uint8; see `texgs.scene.frame.frame`.

        Changes may be made in one thread while another one renders the scene that it was given.

        Args:
            camera: from where.
            mode: what to show.
            scene: one of the history; default as it is now.
            step: of rays through the volume, voxels; default that of its views.
            transparent: whether to leave the background out.
        """
        scene = self.scene if scene is None else scene
        composition = self.composition_of(scene)
        twin = self.twin_of(scene, step) if needs_twin(scene, mode) else None
        return frame(composition, camera, scene, mode, twin, transparent=transparent)

    def picture(self, camera: Camera, shot: Shot, scene: Scene | None = None) -> np.ndarray:
        """Return a frame as a shot has it, with markers and legend on top; see `with_marks`."""
        scene = self.scene if scene is None else scene
        pixels = self.frame(camera, shot.mode, scene, transparent=shot.transparent)
        legend = legend_of(scene, self.composition_of(scene).palettes) if shot.legend else []
        return with_marks(pixels, camera, scene, legend)

    def point_at(self, camera: Camera, mode: str, scene: Scene, pixel: tuple[int, int]) -> list[float] | None:
        """Return the point of a scene of the history that a pixel shows; see `texgs.scene.frame.point_at`."""
        scene = replace(scene, light=scene.light.unhidden)  # shadows hide no point
        is_known = scene.volume is not None and scene.volume.file.is_file() and scene.is_as_volume
        twin = self.twin_of(scene) if is_known or needs_twin(scene, mode) else None
        return point_at(self.composition_of(scene), camera, scene, mode, twin, pixel)

    def slices(self, keys: SliceKeys) -> np.ndarray:
        """Return a picture of slices of the scene's volume; see `slice_picture`."""
        twin = self.twin_of(self.scene)
        return slice_picture(twin.grid, keys, twin.labels(self.scene, self.composition.palettes))

    def twin_of(self, scene: Scene, step: float | None = None) -> Twin:
        """Return the twin of a scene of the history; the latest twins are cached. For `step` see `frame`."""
        state = (scene.volume, state_of(scene.volume.file if scene.volume else None))
        twin = last_of(self._twins, state, lambda: Twin(scene, self._device))
        # With a step, something moves, perhaps a function.
        return twin if step is None else twin.with_step(step, by_cell=False)

    def beside(self, camera: Camera, scene: Scene, step: float | None = None) -> tuple[Render, Render]:
        """Render a scene of the history and the same view of its volume; see `scene_and_volume`."""
        return scene_and_volume(self.composition_of(scene), camera, scene, self.twin_of(scene, step))

    def save(self, path: str | Path) -> Path:
        """Write the scene file in one step; files in it are relative to its folder."""
        return write_scene(path, self.scene)

    def composition_of(self, scene: Scene) -> Composed:
        """Return the joined models of a scene, cached while their files are the same."""
        states = [state_of(file) for file in files_of(scene)]
        return last_of(self._opened, states, lambda: scene.open(self._device))

    # ---- History ------------------------------------------------------------

    def _push_read(self, scene: Scene, models: Iterable[str]) -> None:
        """Add a scene whose models have other files, after reading these."""
        for model in models:
            with errors_at(f"models.{model}"):
                scene.models[model].open()
        self._push(scene)

    def _push(self, scene: Scene) -> None:
        """Add a scene to the history, and clear undone steps."""
        self._past = [*self._past[-HISTORY_STEPS:], (scene, "")]
        self._future.clear()


def files_of(scene: Scene) -> list[Path | None]:
    """Return all files that a scene reads; None stands for a fitted texture."""
    return [file for entry in scene.models.values() for file in entry.files]


def state_of(file: Path | None) -> tuple[object, ...]:
    """Return a state that changes when a file is rewritten or removed."""
    if file is None or not file.exists():
        return (file,)
    status = file.stat()
    return (file, status.st_ino, status.st_mtime_ns, status.st_size)
