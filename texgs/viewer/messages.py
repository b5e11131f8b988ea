"""What a page says to its server: typed, and checked before anything uses it."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NoReturn, get_args

from texgs.core.camera import Camera, orbit
from texgs.core.errors import ArgumentError
from texgs.core.numbers import is_number
from texgs.scene.frame import Mode
from texgs.scene.scene_file import known

LARGEST = 1 << 16  # bytes of a message; a page's own have a few hundred
MOST_PIXELS = 4096  # of a side
FARTHEST = 1000.0  # world units


@dataclass(frozen=True)
class Orbit:
    """A camera that looks at a target, as `texgs.core.camera.orbit` has it."""

    target: tuple[float, float, float]  # world units
    azimuth: float  # degrees
    polar: float  # degrees above the horizon
    distance: float  # world units
    fov_y: float  # degrees
    width: int  # pixels
    height: int  # pixels

    def camera(self, scale: float = 1.0) -> Camera:
        """The camera, with sides of this part of the pixels."""
        width, height = (max(1, round(scale * side)) for side in (self.width, self.height))
        return orbit(self.azimuth, self.polar, self.distance, self.fov_y, width, height, self.target)


@dataclass(frozen=True)
class View:
    """Show a frame."""

    id: int  # comes back with the frame
    camera: Orbit
    mode: Mode
    moving: bool  # another one follows at once: speed counts more than quality
    before: bool  # the scene as it was opened


@dataclass(frozen=True)
class Edit:
    """Change one value of a part, or of the scene where the part is empty."""

    part: str  # MODEL or MODEL/SEGMENT
    key: str  # of a `PartEdit`; "light" or "background" of the scene
    value: Any  # as in a scene file; None takes the edit back
    step: int  # edits of one number in a row are one step of the history, such as those of a slider


@dataclass(frozen=True)
class Undo:
    """Take the latest step back."""


@dataclass(frozen=True)
class Redo:
    """Make the step again that was taken back last."""


@dataclass(frozen=True)
class Save:
    """Write the scene file."""

    name: str  # of the file, in the folder for saving
    replace: bool  # a file that is there already


Message = View | Edit | Undo | Redo | Save


def parse(text: str) -> Message:
    """The message that a text holds.

    Raises:
        ArgumentError: naming what is not as it should be.
    """
    values = parse_json(text)
    known(values, None, "message")
    kind = values.pop("type", None)
    reader = READERS.get(kind) if isinstance(kind, str) else None
    if reader is None:
        raise ArgumentError(f"type: expected one of {', '.join(READERS)}, got {kind!r:.100}")
    return reader(values)


def parse_json(text: str) -> Any:
    """Plain values.

    Raises:
        ArgumentError: if it is no JSON.
    """

    def no_number(name: str) -> NoReturn:
        raise ValueError(f"{name} is no number of JSON")

    try:
        return json.loads(text, parse_constant=no_number)
    except (ValueError, RecursionError) as error:
        raise ArgumentError(f"message: expected JSON, got {text[:100]!r} ({error})") from error


def view_of(values: Mapping[str, Any]) -> View:
    """The view that plain values describe.

    Raises:
        ArgumentError: naming the key that is not as it should be.
    """
    known(values, ("id", "camera", "mode", "moving", "before"), "view")
    mode = values.get("mode", "shaded")
    if mode not in get_args(Mode):
        raise ArgumentError(f"mode: expected one of {', '.join(get_args(Mode))}, got {mode!r:.100}")
    return View(
        id=whole("id", values.get("id", 0), 0, 2**53),
        camera=orbit_of(values.get("camera")),
        mode=mode,
        moving=flag("moving", values.get("moving", False)),
        before=flag("before", values.get("before", False)),
    )


def orbit_of(values: Any) -> Orbit:
    """The camera that plain values describe.

    Raises:
        ArgumentError: naming the key that is not as it should be.
    """
    known(values, ("target", "azimuth", "polar", "distance", "fov_y", "width", "height"), "camera")
    target = values.get("target")
    if not isinstance(target, list) or len(target) != 3:
        raise ArgumentError(f"camera.target: expected three numbers, got {target!r:.100}")
    x, y, z = (number("camera.target", each, -FARTHEST, FARTHEST) for each in target)
    return Orbit(
        target=(x, y, z),
        azimuth=number("camera.azimuth", values.get("azimuth"), -1e6, 1e6),
        polar=number("camera.polar", values.get("polar"), -90, 90),
        distance=number("camera.distance", values.get("distance"), 1e-3, FARTHEST),
        fov_y=number("camera.fov_y", values.get("fov_y"), 1, 150),
        width=whole("camera.width", values.get("width"), 1, MOST_PIXELS),
        height=whole("camera.height", values.get("height"), 1, MOST_PIXELS),
    )


def _edit(values: Mapping[str, Any]) -> Edit:
    known(values, ("part", "key", "value", "step"), "edit")
    return Edit(
        text("part", values.get("part")),
        text("key", values.get("key")),
        values.get("value"),
        whole("step", values.get("step", 0), 0, 2**53),
    )


def _undo(values: Mapping[str, Any]) -> Undo:
    known(values, (), "undo")
    return Undo()


def _redo(values: Mapping[str, Any]) -> Redo:
    known(values, (), "redo")
    return Redo()


def _save(values: Mapping[str, Any]) -> Save:
    known(values, ("name", "replace"), "save")
    return Save(text("name", values.get("name")), flag("replace", values.get("replace", False)))


READERS: dict[str, Callable[[Mapping[str, Any]], Message]] = {
    "view": view_of,
    "edit": _edit,
    "undo": _undo,
    "redo": _redo,
    "save": _save,
}


def number(where: str, value: object, least: float, most: float) -> float:
    """A number of a range.

    Raises:
        ArgumentError: if it is none.
    """
    if not is_number(value) or not least <= value <= most:  # type: ignore[operator]
        raise ArgumentError(f"{where}: expected a number from {least:g} to {most:g}, got {value!r:.100}")
    return float(value)  # type: ignore[arg-type]


def whole(where: str, value: object, least: int, most: int) -> int:
    """A whole number of a range.

    Raises:
        ArgumentError: if it is none.
    """
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
        raise ArgumentError(f"{where}: expected a whole number from {least} to {most}, got {value!r:.100}")
    return value


def flag(where: str, value: object) -> bool:
    """True or false.

    Raises:
        ArgumentError: if it is neither.
    """
    if not isinstance(value, bool):
        raise ArgumentError(f"{where}: expected true or false, got {value!r:.100}")
    return value


def text(where: str, value: object) -> str:
    """A text.

    Raises:
        ArgumentError: if it is none.
    """
    if not isinstance(value, str):
        raise ArgumentError(f"{where}: expected a text, got {value!r:.100}")
    return value
