"""Messages of pages, read from text and checked before anything uses them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from texgs.core.errors import ArgumentError
from texgs.scene.scene_file import known
from texgs.viewer.messages import (
    MODES,
    Cancel,
    Clicked,
    Edit,
    Export,
    Look,
    Mask,
    Message,
    Orbit,
    Redo,
    Remove,
    Rename,
    Save,
    Segment,
    Undo,
    View,
)
from texgs.viewer.values import flag, number, parse_json, whole, words

MOST_PIXELS = 4096  # of a side
NEAREST, FARTHEST = 1e-6, 1e6  # world units
MOST_POINTS = 100
MOST_PARTS = 1000
Reader = Callable[[Mapping[str, Any]], Message]


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


def view_of(values: Mapping[str, Any]) -> View:
    """The view that plain values describe.

    Raises:
        ArgumentError: naming the key that is not as it should be.
    """
    known(values, ("id", "camera", "mode", "moving", "before", "only"), "view")
    mode = values.get("mode", "shaded")
    if mode not in MODES:
        raise ArgumentError(f"mode: expected one of {', '.join(MODES)}, got {mode!r:.100}")
    return View(
        id=whole("id", values.get("id", 0), 0, 2**53),
        camera=orbit_of(values.get("camera")),
        mode=mode,
        moving=flag("moving", values.get("moving", False)),
        before=flag("before", values.get("before", False)),
        only=words("only", values.get("only", "")),
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
        distance=number("camera.distance", values.get("distance"), NEAREST, FARTHEST),
        fov_y=number("camera.fov_y", values.get("fov_y"), 1, 150),
        width=whole("camera.width", values.get("width"), 1, MOST_PIXELS),
        height=whole("camera.height", values.get("height"), 1, MOST_PIXELS),
    )


def clicked_of(values: Mapping[str, Any]) -> Clicked:
    """The clicks in a message.

    Raises:
        ArgumentError: naming the key that is not as it should be.
    """
    camera, points = orbit_of(values.get("camera")), values.get("points")
    if not isinstance(points, list) or not 1 <= len(points) <= MOST_POINTS:
        raise ArgumentError(f"points: expected 1 to {MOST_POINTS} of them, got {points!r:.100}")
    clicks = []
    for point in points:
        if not isinstance(point, list) or len(point) != 3:
            raise ArgumentError(f"points: expected x, y, and true or false, got {point!r:.100}")
        x, y = (number("points", each, -MOST_PIXELS, 2 * MOST_PIXELS) for each in point[:2])
        clicks.append((x, y, flag("points", point[2])))
    return Clicked(camera, tuple(clicks))


def _mask(values: Mapping[str, Any]) -> Mask:
    known(values, ("id", "model", "camera", "points"), "mask")
    number_of = whole("id", values.get("id", 0), 0, 2**53)
    return Mask(number_of, words("model", values.get("model")), clicked_of(values))


def _segment(values: Mapping[str, Any]) -> Segment:
    known(values, ("part", "camera", "points"), "segment")
    return Segment(words("part", values.get("part")), clicked_of(values))


def _look(values: Mapping[str, Any]) -> Look:
    known(values, ("parts", "style", "instruction", "preview"), "look")
    parts = values.get("parts", [])
    if not isinstance(parts, list) or len(parts) > MOST_PARTS:
        raise ArgumentError(f"parts: expected a list of at most {MOST_PARTS}, got {parts!r:.100}")
    return Look(
        tuple(words("parts", each) for each in parts),
        words("style", values.get("style", "")),
        words("instruction", values.get("instruction", "")),
        flag("preview", values.get("preview", False)),
    )


def _export(values: Mapping[str, Any]) -> Export:
    known(values, ("kind", "view"), "export")
    view = values.get("view")
    known(view, None, "view")
    return Export(words("kind", values.get("kind")), view_of(view))  # type: ignore[arg-type]


def _rename(values: Mapping[str, Any]) -> Rename:
    known(values, ("part", "name"), "rename")
    return Rename(words("part", values.get("part")), words("name", values.get("name")))


def _remove(values: Mapping[str, Any]) -> Remove:
    known(values, ("part",), "remove")
    return Remove(words("part", values.get("part")))


def _edit(values: Mapping[str, Any]) -> Edit:
    known(values, ("part", "key", "value", "step"), "edit")
    return Edit(
        words("part", values.get("part")),
        words("key", values.get("key")),
        values.get("value"),
        whole("step", values.get("step", 0), 0, 2**53),
    )


def _save(values: Mapping[str, Any]) -> Save:
    known(values, ("name", "replace"), "save")
    return Save(words("name", values.get("name")), flag("replace", values.get("replace", False)))


def _cancel(values: Mapping[str, Any]) -> Cancel:
    known(values, ("preview",), "cancel")
    return Cancel(flag("preview", values.get("preview", False)))


def _bare(message: Message) -> Reader:
    """Reads a message that has no values."""

    def reader(values: Mapping[str, Any]) -> Message:
        known(values, (), "message")
        return message

    return reader


READERS: dict[str, Reader] = {
    "view": view_of,
    "edit": _edit,
    "undo": _bare(Undo()),
    "redo": _bare(Redo()),
    "save": _save,
    "mask": _mask,
    "segment": _segment,
    "look": _look,
    "export": _export,
    "rename": _rename,
    "remove": _remove,
    "cancel": _cancel,
}
