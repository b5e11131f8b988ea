"""Markers of a scene: what they may be, their place in scene files, and their history."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.fields.surfels.test_composition import ball
from tests.refusals import refused
from texgs.core.errors import ArgumentError
from texgs.core.markers import MAX_LETTERS, MAX_MARKERS, Marker
from texgs.fields.surfels.model_file import write_model
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.scene_file import markers_of, plain_markers, read_scene, write_scene
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
    assert markers_of(plain_markers(value)) == value


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
        said = f"markers: {plain_markers(markers_of(value))}"
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


def test_markers_are_edits_that_are_undone(scene):
    session = Session(scene)
    session.change("", "markers", [{"points": [A], "text": "here"}])
    session.change("", "markers", [*plain_markers(session.scene.markers), {"points": [A, B]}])
    assert session.scene.markers == (Marker((A,), "here"), Marker((A, B)))
    assert session.scene.markers[1].length == pytest.approx(np.linalg.norm(np.subtract(A, B)), rel=1e-15)
    session.undo()
    assert session.scene.markers == (Marker((A,), "here"),)
    session.change("", "markers", None)
    assert session.scene.markers == ()
