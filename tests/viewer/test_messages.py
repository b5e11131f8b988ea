"""Messages of pages: the right ones are read, all others are told in one sentence."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from texgs.core.camera import orbit
from texgs.core.errors import ArgumentError
from texgs.viewer.messages import (
    LOOKS,
    MESSAGES,
    Cancel,
    Edit,
    Fit,
    Keep,
    Look,
    Mask,
    Pick,
    Redo,
    Remove,
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
EXPORT = {"type": "export", "kind": "mp4", "view": VIEW}
PICK = {"type": "pick", "view": VIEW, "pixel": [3, 4]}
MASK = {"type": "mask", "model": "TF01", "camera": CAMERA}
DRAWN = {"points": []}


def test_messages_are_read():
    view = parse(json.dumps(VIEW))
    assert isinstance(view, View)
    assert (view.id, view.mode, view.moving, view.before) == (7, "normal", True, False)
    assert parse(json.dumps(PICK)) == Pick(view, (3, 4))
    edit = {"type": "edit", "part": "TF01", "key": "opacity", "value": 0.5, "step": 3}
    assert parse(json.dumps(edit)) == Edit("TF01", "opacity", 0.5, 3)
    assert parse('{"type": "undo"}') == Undo()
    assert parse('{"type": "redo"}') == Redo()
    assert parse('{"type": "save", "name": "a.yaml"}') == Save("a.yaml", False)
    assert parse('{"type": "cancel"}') == Cancel()
    assert parse('{"type": "fit", "function": "TF03"}') == Fit("TF03")
    assert parse('{"type": "keep", "function": "TF03"}') == Keep("TF03")
    assert parse('{"type": "remove", "part": "TF01/a"}') == Remove("TF01/a")
    look = {"type": "look", "parts": ["TF01"], "style": "glass", "sphere": True, "camera": CAMERA}
    assert parse(json.dumps(look)) == Look(("TF01",), "glass", sphere=True, camera=view.camera)
    clicks = {"camera": CAMERA, "points": [[1, 2.5, True], [3, 4, False]]}
    clicked = (view.camera, ((1, 2.5, True), (3, 4, False)))
    mask, segment = {"type": "mask", "id": 4, "model": "TF01"}, {"type": "segment", "part": "TF01/a"}
    assert parse(json.dumps(mask | clicks)) == Mask(*clicked, "TF01", 4)
    assert parse(json.dumps(segment | clicks)) == Segment(*clicked, "TF01/a")
    drawn = mask | {"camera": CAMERA, "points": [], "outline": [[0, 0], [9, 0], [9, 9.5]]}
    corners = ((0, 0), (9, 0), (9, 9.5))
    assert parse(json.dumps(drawn)) == Mask(view.camera, (), "TF01", 4, outline=corners)


@pytest.mark.parametrize(
    ("part", "key", "value", "title"),
    [
        ("TF01", "opacity", 0.123456, "TF01 opacity 0.1235"),
        ("TF01", "opacity", 1000, "TF01 opacity 1000"),
        ("", "time", 12345, "time 12345"),
        ("TF01", "palette", [1, 0.5, 0], "TF01 palette #ff8000"),
        ("TF01", "palette", "#00ff00", "TF01 palette #00ff00"),
        ("TF01/a", "visible", False, "TF01/a visible off"),
        ("TF01", "palette", None, "TF01 palette reset"),
        ("", "light", "headlight", "light headlight"),
        ("", "light", {"polar": 12.4}, "light polar 12°"),
        ("", "cuts", {"planes": [{}], "box": None, "faces": "unlit"}, "cuts 1 plane, unlit"),
        ("", "cuts", {"planes": [{}, {}], "box": {}, "faces": "shaded"}, "cuts 2 planes"),
        ("", "cuts", {"box": {"low": [0, 0, 0]}}, "cuts box"),
        ("", "cuts", {"planes": [], "faces": "unlit"}, "cuts none"),
        ("", "cuts", None, "cuts reset"),
    ],
)
def test_edits_have_titles(part, key, value, title):
    assert Edit(part, key, value, 0).title == title


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
        (VIEW, {"type": "run"}, f"type: expected one of {', '.join(TYPES)}, got"),
        (VIEW, {"type": ["view"]}, "type: expected one of view, pick, edit, undo,"),
        (VIEW, {"mode": "x"}, "mode: expected 'shaded', "),
        (VIEW, {"id": -1}, "id: expected greater than or equal to 0, got -1"),
        (VIEW, {"moving": 1}, "moving: expected a valid boolean, got 1"),
        (VIEW, {"colour": 1}, "message: no such key 'colour'"),
        (VIEW, {"camera": None}, "camera: expected keys with values in JSON, got None"),
        (
            VIEW,
            {"camera": {**CAMERA, "polar": 91}},
            "camera.polar: expected less than or equal to 90, got 91",
        ),
        (VIEW, {"camera": {**CAMERA, "width": 1e3}}, "camera.width: expected a valid integer, got 1000.0"),
        (VIEW, {"camera": {**CAMERA, "width": 9000}}, "camera.width: expected less than or equal to 4096"),
        (VIEW, {"camera": {**CAMERA, "target": [0, 0]}}, "camera.target.2: expected a value, got none"),
        (VIEW, {"camera": {**CAMERA, "distance": "3"}}, "camera.distance: expected a valid number, got '3'"),
        (VIEW, {"only": None}, "only: expected a valid string, got None"),
        (VIEW, {"type": "undo"}, "message: no such key 'id'"),
        (PICK, {"pixel": [3, -1]}, "pixel.1: expected greater than or equal to 0, got -1"),
        (PICK, {"pixel": [3, 4096]}, "pixel.1: expected less than 4096, got 4096"),
        (PICK, {"view": {**VIEW, "mode": "x"}}, "view.mode: expected 'shaded', "),
        (EXPORT, {"seconds": 1e9}, "seconds: expected less than or equal to 600, got 1000000000.0"),
        (EXPORT, {"stops": [CAMERA] * 21}, "stops: Tuple should have at most 20 items"),
        (EXPORT, {"fps": 0}, "fps: expected greater than or equal to 1, got 0"),
        (EXPORT, {"view": {**VIEW, "transparent": 1}}, "view.transparent: expected a valid boolean, got 1"),
        ({"type": "fit"}, {}, "function: expected a value, got none"),
        ({"type": "keep"}, {"function": ["TF03"]}, "function: expected a valid string, got ['TF03']"),
        (MASK, {"points": None}, "points: expected a valid array, got None"),
        (MASK, {"points": [[1, 2, True]] * 101}, "points: Tuple should have at most 100 items"),
        (MASK, {"points": [[1, 2]]}, "points.0.2: expected a value, got none"),
        (MASK, {"points": [[1, "2", True]]}, "points.0.1: expected a valid number, got '2'"),
        (MASK, {**DRAWN, "outline": [[1, 2], [3, 4]]}, "outline: Tuple should have at least 3 items"),
        (MASK, {**DRAWN, "outline": [[1, 2]] * 501}, "outline: Tuple should have at most 500 items"),
        (MASK, {**DRAWN, "outline": [[1, 2, 3]] * 3}, "outline.0: Tuple should have at most 2 items"),
        (MASK, {**DRAWN, "outline": [[1]] * 3}, "outline.0.1: expected a value, got none"),
        (MASK, {**DRAWN, "outline": [[1, None]] * 3}, "outline.0.1: expected a valid number, got None"),
        (MASK, {**DRAWN, "outline": [[1, 1e9]] * 3}, "outline.0.1: expected less than or equal to 8192"),
        (MASK, {**DRAWN, "outline": [[float("nan"), 1]] * 3}, "outline.0.0: expected a finite number"),
        (MASK, {**DRAWN, "outline": "box"}, "outline: expected a valid array, got 'box'"),
        (MASK, {"points": [[1, 2, 1]]}, "points.0.2: expected a valid boolean, got 1"),
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
        "model", "points", "outline", "function", "view", "pixel", "kind", "stops", "seconds",
        "fps", "parts", "style", "instruction", "sphere", "preview")  # fmt: skip


@pytest.mark.parametrize("adapter", [MESSAGES, LOOKS])
@given(st.sampled_from(TYPES), st.dictionaries(st.sampled_from(KEYS), VALUES))
def test_nothing_else_is_raised(adapter, kind, values):
    try:
        parse(json.dumps({"type": kind, **values}), adapter)
    except ArgumentError as error:
        assert len(str(error)) < 2100  # noqa: PT017  one sentence, of bounded length
