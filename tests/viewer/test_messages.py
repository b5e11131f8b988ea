"""Messages of pages: the right ones are read, all others are told in one sentence."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from texgs.core.camera import orbit
from texgs.core.errors import ArgumentError
from texgs.viewer.messages import (
    Edit,
    Look,
    Mask,
    Pick,
    Save,
    Segment,
    Undo,
    View,
    parse,
)

ANGLES = {"azimuth": 30, "polar": 20, "distance": 3, "fov_y": 40}
CAMERA = {"target": [0, 0, 0], **ANGLES, "width": 64, "height": 48}
TYPES = ["view", "pick", "edit", "undo", "redo", "save", "mask", "segment", "look", "fit", "keep"]
TYPES += ["export", "rename", "remove", "cancel"]
VIEW = {"type": "view", "id": 7, "camera": CAMERA, "mode": "normal", "moving": True, "before": False}
SHOWN = {key: value for key, value in VIEW.items() if key != "type"}
PICK = {"type": "pick", "view": SHOWN, "pixel": [3, 4]}
EXPORT = {"type": "export", "kind": "mp4", "view": SHOWN}
MASK = {"type": "mask", "model": "TF01", "camera": CAMERA}
DRAWN = {"points": []}


def test_messages_are_read():
    view = parse(json.dumps(VIEW))
    assert isinstance(view, View)
    assert (view.id, view.mode, view.moving, view.before) == (7, "normal", True, False)
    corners = ((0, 0), (9, 0), (9, 9.5))
    for message, expected in (
        (PICK, Pick(view, (3, 4))),
        ({"type": "undo"}, Undo()),
        ({"type": "save", "name": "a.yaml"}, Save("a.yaml", False)),
        (
            {"type": "edit", "part": "TF01", "key": "opacity", "value": 0.5, "step": 3},
            Edit("TF01", "opacity", 0.5, 3),
        ),
        (
            {"type": "look", "parts": ["TF01"], "style": "glass", "sphere": True, "camera": CAMERA},
            Look(("TF01",), "glass", sphere=True, hue=1.0, camera=view.camera),
        ),
        ({"type": "look", "instruction": "gold", "hue": 0}, Look(instruction="gold", hue=0.0)),
        (
            {"type": "segment", "part": "TF01/a", "camera": CAMERA, "points": [[1, 2.5, True]]},
            Segment(view.camera, ((1, 2.5, True),), part="TF01/a"),
        ),
        (
            {**MASK, "id": 4, "points": [], "outline": [[*corner] for corner in corners]},
            Mask(view.camera, (), corners, "TF01", 4),
        ),
    ):
        assert parse(json.dumps(message)) == expected


def test_a_camera_is_that_of_the_renderer_and_half_of_it_sees_the_same():
    half, whole = (parse(json.dumps(VIEW)).camera.camera(scale) for scale in (0.5, 1))
    expected = orbit(30, 20, 3, 40, 64, 48)
    assert whole.viewmat.equal(expected.viewmat)
    assert whole.K.equal(expected.K)
    assert (half.width, half.height) == (32, 24)
    point = half.viewmat.new_tensor([0.2, -0.1, 0.3])
    assert (2 * half.project(point)[0]).allclose(whole.project(point)[0])


@pytest.mark.parametrize(
    ("whole", "change", "message"),
    [
        (VIEW, {"type": "run"}, f"type: expected one of {', '.join(TYPES)}, got 'run'"),
        (VIEW, {"type": ["view"]}, "type: expected one of view, pick, edit, undo,"),
        (VIEW, {"mode": "shade"}, "mode: expected one of shaded, "),
        (VIEW, {"id": -1}, "id: expected at least 0, got -1"),
        (VIEW, {"colour" * 100: 1}, f"{('colour' * 10)}: no such key"),
        (VIEW, {"camera": None}, "camera: expected keys with values, got null"),
        (VIEW, {"camera": {**CAMERA, "polar": 91}}, "camera.polar: expected at most 90, got 91"),
        (VIEW, {"camera": {**CAMERA, "azimuth": 1e400}}, "camera.azimuth: expected a finite number"),
        (VIEW, {"camera": {}}, "camera.target: expected a value, got none"),
        (VIEW, {"type": "undo"}, "id: no such key"),
        (PICK, {"pixel": [3, 4096]}, "pixel: expected at most 4095, got 4096"),
        (EXPORT, {"keys": [{}] * 21}, "keys: expected 0 to 20 values, got 21"),
        (EXPORT, {"fps": 0}, "fps: expected at least 1, got 0"),
        ({"type": "look"}, {"hue": 1.01}, "hue: expected at most 1, got 1.01"),
        ({"type": "look"}, {"hue": -0.01}, "hue: expected at least 0, got -0.01"),
        (MASK, {"points": [[1, "a", True]]}, "points.0.1: expected a number, got 'a'"),
        (MASK, {**DRAWN, "outline": [[1, 2], [3, 4]]}, "outline: expected 3 to 500 values, got 2"),
        (MASK, {**DRAWN, "outline": [[float("nan"), 1]] * 3}, "outline: expected a finite number"),
    ],
)
def test_what_is_wrong_is_named(whole, change, message):
    with pytest.raises(ArgumentError) as error:
        parse(json.dumps({**whole, **change}))
    assert str(error.value).startswith(message)


@pytest.mark.parametrize("text", ["", "{", "NaN", "[" * 5000, '"' * 3, "1" * 5000])
def test_what_is_no_json_is_told(text):
    with pytest.raises(ArgumentError, match="message: expected"):
        parse(text)


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from([*CAMERA, "x"]), inner),
    max_leaves=8,
)


KEYS = ("id", "camera", "mode", "moving", "before", "only", "part", "key", "value", "step", "name", "replace",
        "model", "points", "outline", "function", "view", "pixel", "kind", "keys", "fps",
        "fps", "parts", "style", "instruction", "sphere", "hue", "preview")  # fmt: skip


@pytest.mark.parametrize("wanted", [None, Look])
@given(st.sampled_from(TYPES), st.dictionaries(st.sampled_from(KEYS), VALUES))
def test_nothing_else_is_raised(wanted, kind, values):
    try:
        parse(json.dumps({"type": kind, **values}), wanted)
    except ArgumentError as error:
        assert len(str(error)) < 2100  # noqa: PT017  one sentence, of bounded length
