"""Markers of a scene: what they may be, their place in scene files, and their history."""

import math
from contextlib import suppress
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.fields.surfels.test_composition import ball
from tests.refusals import refused
from tests.scene.test_marks import MM
from texgs.api.scene import open_scene
from texgs.core.errors import ArgumentError
from texgs.core.markers import MAX_LETTERS, MAX_MARKERS, Marker
from texgs.fields.surfels.model_file import write_model
from texgs.scene.changes import apply_all
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.scene_file import markers_of, read_scene, write_scene
from texgs.scene.session import Session

A, B = (0.25, -0.5, 0.125), (-0.1, 0.2, 0.3)
places = st.tuples(*[st.floats(-1e6, 1e6)] * 3)
texts = st.text(st.characters(exclude_categories=["C", "Z"]), max_size=MAX_LETTERS)
markers = st.builds(Marker, st.lists(places, min_size=1, max_size=2).map(tuple), texts)


@pytest.fixture
def scene(tmp_path):
    return Scene({"TF01": SceneModel(write_model(tmp_path / "model.safetensors", ball(1)))})


@given(st.lists(markers, max_size=5).map(tuple))
def test_every_marker_is_read_as_it_was_written(value):
    assert markers_of([asdict(each) for each in value]) == value


def test_scene_files_keep_markers_and_those_without_have_no_key(scene, tmp_path):
    path = write_scene(tmp_path / "scene.yaml", scene)
    before = path.read_bytes()
    assert b"markers" not in before
    marked = replace(scene, markers=(Marker((A,), "näve: #1 {x}"), Marker((A, B))))
    assert read_scene(write_scene(path, marked)).markers == marked.markers
    assert path.read_bytes().startswith(before), "what was there stays as it was"


@given(
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
        lambda inner: (
            st.lists(inner, max_size=4)
            | st.fixed_dictionaries({"points": inner}, optional={"text": inner, "more": inner})
        ),
        max_leaves=12,
    )
)
def test_anything_is_markers_or_refused_in_a_sentence(value):
    try:
        said = f"markers: {markers_of(value)}"
    except ArgumentError as error:
        said = str(error)
    assert said.startswith(("markers", "text of a marker"))
    assert said.isprintable()


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ([{"points": []}], "markers.0.points: expected 1 to 2 values, got 0"),
        ([{"points": [A, B, A]}], "markers.0.points: expected 1 to 2 values, got 3"),
        ([{"points": [A]}, {"points": [[1, 2]]}], "markers.1.points.0: expected 3 values, got 2"),
        ([{"points": [[1, 2, float("nan")]]}], "expected a finite number, got nan"),
        ([{"points": [[1, 2, 2e6]]}], "expected at most 1e.06, got 2000000"),
        ([{"points": [A], "text": "x" * (MAX_LETTERS + 1)}], "at most 200 printable letters"),
        ([{"points": [A], "text": "two\nlines"}], "at most 200 printable letters"),
        ([{"points": [A]}] * (MAX_MARKERS + 1), "markers: expected 0 to 100 values, got 101"),
        ([{"points": [A], "color": "red"}], "markers.0.color: no such key"),
        ("none", "markers: expected a list"),
    ],
)
def test_a_marker_that_cannot_be_leaves_the_scene(scene, value, message):
    session = Session(scene)
    refused(lambda: session.set_of_scene("markers", value), message)
    assert session.scene is scene


@pytest.mark.parametrize(("space", "scale"), [(MM, 200), (None, 1)])
def test_words_mark_places_of_the_file(scene, space, scale):
    session = Session(replace(scene, space=space))
    apply_all(session, ["marker=the aorta@12.5,-30,44", "distance=1,2,3:4,6,3", "distance=a:b@@0,0,0:1,0,0"])
    first, second, third = session.scene.markers
    assert (first.text, second.text, third.text) == ("the aorta", "", "a:b@")
    assert math.dist(*second.points) * scale == pytest.approx(5)
    to_file = space.points if space else np.asarray
    assert np.allclose(to_file(np.array(first.points)), [[12.5, -30, 44]])
    for word in ("marker=none", "distance="):
        apply_all(session, [word])
        assert session.scene.markers == ()
        session.undo()


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("marker=1,2", "marker=1,2: expected TEXT@X,Y,Z, got 1,2"),
        ("marker=x@1,2,3:4,5,6", "expected TEXT@X,Y,Z, got"),
        ("distance=1,2,3", "expected X,Y,Z:X,Y,Z or TEXT@X,Y,Z:X,Y,Z, got 1,2,3"),
        ("marker=x@1,2,z", "expected three numbers a place"),
        ("marker=x@1,2,nan", "marker.points: expected a finite number, got nan"),
        ("marker=x@1,2,3e9", "marker.points: expected at most 1e.06"),
        (f"marker={'x' * 300}@1,2,3", "at most 200 printable letters"),
        ("markers=1,2,3", "no such key 'markers', did you mean marker?"),
    ],
)
def test_a_word_that_cannot_mark_leaves_the_scene(scene, word, message):
    session = Session(scene)
    refused(lambda: apply_all(session, ["light=30,40", word]), message)
    assert session.scene is scene


@given(st.text(max_size=30), st.sampled_from(["marker", "distance"]))
def test_any_text_marks_or_is_refused_in_a_sentence(text, name):
    session = Session(Scene({"TF01": SceneModel(Path("model.safetensors"))}))
    with suppress(ArgumentError):
        apply_all(session, [f"{name}={text}"])


def test_python_marks_places_of_the_file(scene, tmp_path):
    scene = open_scene(write_scene(tmp_path / "scene.yaml", replace(scene, space=MM)))
    assert scene.mark([5, -7, 9], text="middle").mark((5, -7, 9), np.array([5, 13, 9])) is scene
    one, two = scene.markers
    assert np.allclose(one.points, 0)
    assert one.text == "middle"
    assert math.dist(*two.points) * 200 == pytest.approx(20)
    copied = open_scene(scene.save(tmp_path / "copy"))
    assert copied.markers == scene.markers
    refused(lambda: scene.mark([1, 2]), "expected three numbers a place")
    refused(lambda: scene.mark(), "marker.points: expected 1 to 2 values, got 0")
    scene.undo()
    assert scene.markers == (one,)
    scene.markers = None
    assert scene.markers == ()


def test_markers_are_edits_that_are_undone(scene):
    session = Session(scene)
    session.change("", "markers", [{"points": [A], "text": "here"}])
    session.change("", "markers", [*session.scene.markers, {"points": [A, B]}])
    assert session.scene.markers == (Marker((A,), "here"), Marker((A, B)))
    session.undo()
    assert session.scene.markers == (Marker((A,), "here"),)
    session.change("", "markers", None)
    assert session.scene.markers == ()
