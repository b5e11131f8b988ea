"""Markers and a legend on top of pictures: where they are drawn, what they say, and what stays as it was."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.fields.surfels.test_composition import ball
from texgs.core.camera import orbit
from texgs.core.markers import Marker
from texgs.fields.surfels.model_file import write_model
from texgs.scene.legend import Entry
from texgs.scene.marks import HALO, INK, length_of, with_marks
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.session import Session
from texgs.scene.shot import Shot
from texgs.volume.space import LPS, Space

CAMERA = orbit(30, 20, 2.0, 40, 320, 240)
MM = Space(LPS, "mm", [[0, 200.0, 0, 5], [200, 0, 0, -7], [0, 0, -200, 9], [0, 0, 0, 1]])
A, B = (0.0, 0.0, 0.0), (0.2, -0.1, 0.15)
LEGEND = [Entry("bone", [(0.9, 0.8, 0.1)], "15 to 75"), Entry("liver", [(0.6, 0.1, 0.1)])]


@pytest.fixture
def scene(tmp_path):
    return Scene({"TF01": SceneModel(write_model(tmp_path / "model.safetensors", ball(1)))})


def pixel_of(point):
    """The pixel of a point by the pinhole formula, in NumPy alone."""
    x, y, z = CAMERA.viewmat.double().numpy()[:3] @ [*point, 1.0]
    f = 240 / 2 / np.tan(np.radians(20))
    return int(160 + f * x / z), int(120 + f * y / z)


def grey(level=128, channels=3):
    return np.full((240, 320, channels), level, np.uint8)


def drawn(scene, *markers, on=None, legend=()):
    return with_marks(grey() if on is None else on, CAMERA, replace(scene, markers=markers), legend)


@pytest.mark.parametrize("point", [A, B, (-0.3, 0.2, 0.1)])
def test_a_point_is_dark_with_a_light_rim_where_the_camera_sees_it(scene, point):
    picture, (x, y) = drawn(scene, Marker((point,))), pixel_of(point)
    assert picture[y, x].tolist() == list(INK[:3])
    changed = np.argwhere((picture != 128).any(axis=-1))
    assert np.linalg.norm(changed - (y, x), axis=1).max() < 8
    assert np.allclose(changed.mean(axis=0), (y, x), atol=1)
    assert (picture == HALO[0]).all(axis=-1).any()


def test_a_distance_is_a_line_between_its_points(scene):
    picture = drawn(scene, Marker((A, B)))
    for share in np.linspace(0, 1, 9):  # of the line in the picture, which is straight
        x, y = (1 - share) * np.array(pixel_of(A)) + share * np.array(pixel_of(B))
        near = picture[round(y) - 1 : round(y) + 2, round(x) - 1 : round(x) + 2]
        assert near.min() < 60


def test_a_text_is_beside_its_point_and_stays_in_the_picture(scene):
    plain, x = drawn(scene, Marker((A,))), pixel_of(A)[0]
    right = np.flatnonzero((drawn(scene, Marker((A,), "here")) != plain).any(axis=(0, 2)))
    assert x < right.min() < right.max() < x + 100
    edge = tuple(0.85 * x for x in CAMERA.viewmat[0, :3].tolist())
    x = pixel_of(edge)[0]
    assert x > 280
    left = np.flatnonzero(
        (drawn(scene, Marker((edge,), "a longer text")) != drawn(scene, Marker((edge,)))).any(axis=(0, 2))
    )
    assert left.max() < x, "there is no room to the right"


def test_what_is_behind_the_camera_is_not_drawn(scene):
    back = tuple(1.5 * x for x in CAMERA.position.tolist())
    assert np.array_equal(drawn(scene, Marker((back,), "behind")), grey())
    assert np.array_equal(drawn(scene, Marker((A, back), "behind")), grey())


def test_a_point_outside_of_the_picture_is_not_drawn_and_a_line_from_inside_is(scene):
    right = CAMERA.viewmat[0, :3].tolist()
    outside = tuple(2 * x for x in right)
    assert pixel_of(outside)[0] > 320
    assert np.array_equal(drawn(scene, Marker((outside,), "outside")), grey())
    picture, (_, y) = drawn(scene, Marker((A, outside))), pixel_of(A)
    assert (picture[y - 2 : y + 3, 310].min(axis=0) < 120).all()


@given(
    st.lists(
        st.tuples(*[st.floats(-1e6, 1e6)] * 3) | st.tuples(*[st.floats(-1, 1)] * 3), min_size=1, max_size=2
    )
)
def test_any_marker_is_drawn_or_not(points):
    scene = Scene({"TF01": SceneModel("model.safetensors")}, markers=(Marker(tuple(points), "text"),))
    assert with_marks(grey(), CAMERA, scene).shape == (240, 320, 3)


def test_lengths_are_those_of_the_files_space():
    marker = Marker((A, B))
    places = MM.points(np.array([A, B]))
    length = np.linalg.norm(places[1] - places[0])
    assert length_of(marker, MM) == f"{length:.3g} mm" == "53.9 mm"
    assert length_of(marker, None) == f"{np.linalg.norm(B):.3g} world units"
    assert length_of(marker, Space()) == f"{np.linalg.norm(B):.3g} volume units"
    assert length_of(Marker(((0.0, 0.0, 0.0), (100.0, 0.0, 0.0))), MM) == "20000 mm"
    assert (
        length_of(
            Marker(((0.0, 0.0, 0.0), (0.99975, 0.0, 0.0))), Space(matrix=np.diag([1e3, 1e3, 1e3, 1]).tolist())
        )
        == "1000 volume units"
    )
    assert length_of(Marker((A,)), MM) == ""


@given(st.tuples(*[st.floats(-1, 1)] * 3))
def test_the_space_leads_to_the_world_and_back(place):
    assert np.allclose(MM.in_world(MM.points(np.array([place]))), [place], atol=1e-12)


def test_transparent_pictures_keep_their_alpha(scene):
    empty, (x, y) = grey(0, 4), pixel_of(A)
    picture = drawn(scene, Marker((A,), "here"), on=empty)
    assert picture[y, x].tolist() == list(INK)
    assert picture[0, 0].tolist() == [0, 0, 0, 0], "what is not drawn on stays"
    over = np.concatenate([grey(100), grey(77, 1)], axis=-1)
    marked = drawn(scene, Marker((A,), "here"), on=over)
    far = np.ones((240, 320), bool)
    far[y - 20 : y + 20, x - 20 : x + 120] = False
    assert np.array_equal(marked[far], over[far])
    # Over a ground, a transparent picture looks as one that was drawn over it.
    for ground in (0, 255):
        alpha = picture[..., 3:] / 255
        seen = alpha * picture[..., :3] + (1 - alpha) * ground
        assert np.abs(seen - drawn(scene, Marker((A,), "here"), on=grey(ground))).max() <= 1.5


def test_a_legend_has_its_colours_in_the_lower_left_corner(scene):
    picture = drawn(scene, legend=LEGEND)
    for entry in LEGEND:
        rows, columns = np.nonzero((picture == np.rint(255 * np.array(entry.colors[0]))).all(axis=-1))
        assert len(rows) > 30
        assert rows.min() > 160
        assert columns.max() < 80
    assert np.array_equal(picture[:100], grey()[:100])


def test_a_legend_of_many_lines_is_as_small_as_it_has_to_be(scene):
    many = [Entry(f"a part with a long name {i}", [(1.0, 0.0, i / 40)]) for i in range(40)]
    picture = drawn(scene, legend=many)
    for row in (0, 39):
        color = np.rint(255 * np.array(many[row].colors[0])).astype(np.uint8)
        assert (picture == color).all(axis=-1).any()


def test_pictures_have_marks_and_frames_have_not(scene):
    session = Session(scene)
    plain = session.frame(CAMERA)
    assert np.array_equal(session.picture(CAMERA, Shot()), plain), "without markers nothing changes"
    assert not np.array_equal(session.picture(CAMERA, Shot(legend=True)), plain)
    session.set_of_scene("markers", [{"points": [A], "text": "here"}])
    assert np.array_equal(session.frame(CAMERA), plain)
    marked, (x, y) = session.picture(CAMERA, Shot(transparent=True)), pixel_of(A)
    assert marked[y, x].tolist() == list(INK)
