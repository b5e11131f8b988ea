"""Messages of pages: the right ones are read, all others are told in one sentence."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from texgs.core.camera import orbit
from texgs.core.errors import ArgumentError
from texgs.viewer.messages import (
    Cancel,
    Clicked,
    Edit,
    Mask,
    Redo,
    Remove,
    Save,
    Segment,
    Undo,
    View,
)
from texgs.viewer.reading import READERS, parse

CAMERA = {
    "target": [0, 0, 0],
    "azimuth": 30,
    "polar": 20,
    "distance": 3,
    "fov_y": 40,
    "width": 64,
    "height": 48,
}
VIEW = {"type": "view", "id": 7, "camera": CAMERA, "mode": "normal", "moving": True, "before": False}


def test_messages_are_read():
    view = parse(json.dumps(VIEW))
    assert isinstance(view, View)
    assert (view.id, view.mode, view.moving, view.before) == (7, "normal", True, False)
    edit = {"type": "edit", "part": "TF01", "key": "opacity", "value": 0.5, "step": 3}
    assert parse(json.dumps(edit)) == Edit("TF01", "opacity", 0.5, 3)
    assert parse('{"type": "undo"}') == Undo()
    assert parse('{"type": "redo"}') == Redo()
    assert parse('{"type": "save", "name": "a.yaml"}') == Save("a.yaml", False)
    assert parse('{"type": "cancel"}') == Cancel()
    assert parse('{"type": "remove", "part": "TF01/a"}') == Remove("TF01/a")
    clicks = {"camera": CAMERA, "points": [[1, 2.5, True], [3, 4, False]]}
    clicked = Clicked(view.camera, ((1, 2.5, True), (3, 4, False)))
    assert parse(json.dumps({"type": "mask", "id": 4, "model": "TF01", **clicks})) == Mask(4, "TF01", clicked)
    assert parse(json.dumps({"type": "segment", "part": "TF01/a", **clicks})) == Segment("TF01/a", clicked)


@pytest.mark.parametrize(
    ("part", "key", "value", "title"),
    [
        ("TF01", "opacity", 0.123456, "TF01 opacity 0.1235"),
        ("TF01", "opacity", 1000, "TF01 opacity 1000"),
        ("TF01", "palette", [1, 0.5, 0], "TF01 palette #ff8000"),
        ("TF01", "palette", "#00ff00", "TF01 palette #00ff00"),
        ("TF01/a", "visible", False, "TF01/a visible off"),
        ("TF01", "palette", None, "TF01 palette reset"),
        ("", "light", "headlight", "light headlight"),
        ("", "light", {"polar": 12.4}, "light polar 12°"),
    ],
)
def test_edits_have_titles(part, key, value, title):
    assert Edit(part, key, value, 0).title == title


def test_a_camera_is_that_of_the_renderer():
    camera, expected = parse(json.dumps(VIEW)).camera.camera(), orbit(30, 20, 3, 40, 64, 48)
    assert camera.viewmat.equal(expected.viewmat)
    assert camera.K.equal(expected.K)


def test_half_of_a_camera_sees_the_same():
    half, whole = (parse(json.dumps(VIEW)).camera.camera(scale) for scale in (0.5, 1))
    assert (half.width, half.height) == (32, 24)
    point = half.viewmat.new_tensor([0.2, -0.1, 0.3])
    assert (2 * half.project(point)[0]).allclose(whole.project(point)[0])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"type": "run"},
            "type: expected one of view, edit, undo, redo, save, mask, segment, look, export, rename, "
            "remove, cancel, got",
        ),
        ({"type": ["view"]}, "type: expected one of view, edit, undo, redo,"),
        ({"mode": "x"}, "mode: expected one of shaded"),
        ({"id": -1}, "id: expected a whole number from 0 to"),
        ({"moving": 1}, "moving: expected true or false, got 1"),
        ({"colour": 1}, "view: no such key 'colour'"),
        ({"camera": None}, "camera: expected a table"),
        ({"camera": {**CAMERA, "polar": 91}}, "camera.polar: expected a number from -90 to 90, got 91"),
        ({"camera": {**CAMERA, "width": 1e3}}, "camera.width: expected a whole number from 1 to 4096"),
        ({"camera": {**CAMERA, "width": 9000}}, "camera.width: expected a whole number from 1 to 4096"),
        ({"camera": {**CAMERA, "target": [0, 0]}}, "camera.target: expected three numbers, got [0, 0]"),
        ({"camera": {**CAMERA, "distance": "3"}}, "camera.distance: expected a number from 1e-06 to 1e+06"),
        ({"only": None}, "only: expected a text, got None"),
        ({"type": "undo"}, "message: no such key 'id'"),
    ],
)
def test_what_is_wrong_is_named(change, message):
    with pytest.raises(ArgumentError) as error:
        parse(json.dumps({**VIEW, **change}))
    assert str(error.value).startswith(message)


@pytest.mark.parametrize("text", ["", "{", "NaN", '{"type": NaN}', "[" * 5000, '"' * 3, "1" * 5000])
def test_what_is_no_json_is_told(text):
    with pytest.raises(ArgumentError, match="message: expected"):
        parse(text)


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from([*CAMERA, "x"]), inner),
    max_leaves=8,
)


KEYS = ("id", "camera", "mode", "moving", "before", "only", "part", "key", "value", "step", "name", "replace",
        "model", "points")  # fmt: skip


@given(
    st.sampled_from(list(READERS)),
    st.dictionaries(st.sampled_from(KEYS), VALUES),
)
def test_nothing_else_is_raised(kind, values):
    try:
        parse(json.dumps({"type": kind, **values}))
    except ArgumentError as error:
        assert len(str(error)) < 2100  # noqa: PT017  one sentence, of bounded length


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (None, "points: expected 1 to 100 of them, got None"),
        ([[1, 2, True]] * 101, "points: expected 1 to 100 of them"),
        ([[1, 2]], "points: expected x, y, and true or false, got [1, 2]"),
        ([[1, "2", True]], "points: expected a number from -4096 to 8192, got '2'"),
        ([[1, 2, 1]], "points: expected true or false, got 1"),
    ],
)
def test_what_is_wrong_with_clicks_is_named(points, message):
    with pytest.raises(ArgumentError) as error:
        parse(json.dumps({"type": "mask", "model": "TF01", "camera": CAMERA, "points": points}))
    assert str(error.value).startswith(message)
