"""Films through keys: exact at keys, smooth and within bounds between them, and keys that are none."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import torch
import yaml
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

import texgs
from tests.refusals import refused
from tests.scene.balls import ball_models, balls_in_a_volume, write_balls
from texgs.cli.main import main
from texgs.core.light import HEADLIGHT, Light
from texgs.core.oklab import oklab
from texgs.fields.surfels.step_file import write_step
from texgs.scene.changes import apply_all
from texgs.scene.film import Film
from texgs.scene.keyframes import keyed_shots
from texgs.scene.scene import Scene
from texgs.scene.series_file import Series, write_series
from texgs.scene.session import Session

EDITS = (
    {"azimuth": -100, "light": "20,30", "cut": "x,0.2"},
    {"azimuth": 150, "polar": -90, "seconds": 1.2, "low.opacity": 0.3, "cut.1": "x,-0.1"},
    {"radius": 2.5, "target": [0.1, 0, 0], "low.palette": "#2040ff", "light": {"azimuth": 100, "polar": 50}},
    {"fov_y": 50, "low.palette": None, "high.visible": False, "cut": None, "shadows": 0.5},
)


@pytest.fixture
def scene(tmp_path):
    """Two balls with a volume."""
    return balls_in_a_volume(tmp_path)


def through(scene, *keys, **values):
    """Shots and scenes of a film through keys, a frame each tenth of a second."""
    film = Film(keys=[*keys], fps=10, **values)
    return [*keyed_shots(film.keys, scene, scene.open())]


def turns(*azimuths, **keys):
    return [{"azimuth": azimuth, "seconds": 1, **keys} for azimuth in azimuths]


def test_frames_at_keys_are_pictures_of_the_edited_scene(scene, tmp_path):
    """Those of `texgs edit` and `texgs render`, one after the other; 20 frames a key but for one."""
    film, session, camera = Film(keys=[*EDITS], fps=10, width=48), Session(scene), {}
    frames = [session.picture(at, film, shown) for at, shown in film.shots(scene)]
    assert len(frames) == film.count == 20 + 12 + 12 + 1
    edited, words = Session(scene), [
        ["light=20,30", "cut=x,0.2"],
        ["low.opacity=0.3", "cut.1=x,-0.1"],
        ["low.palette=#2040ff", "light=100,50"],
        ["low.palette=", "high.visible=false", "cut=", "shadows=0.5"],
    ]  # fmt: skip
    for place, key, changes in zip((0, 20, 32, 44), EDITS, words, strict=True):
        apply_all(edited, changes)
        camera |= {
            name: each
            for name, each in key.items()
            if name in ("azimuth", "polar", "radius", "fov_y", "target")
        }
        shot = Film(width=48, **camera)
        expected = edited.picture(shot.camera(scene.framed()), shot)
        assert np.array_equal(frames[place], expected), f"frame {place}"
    assert all((one != other).any() for one, other in pairwise(frames))


@given(
    st.lists(st.floats(0, 1, allow_subnormal=False), min_size=2, max_size=5),
    st.lists(st.floats(-720, 720), min_size=2, max_size=5),
)
def test_numbers_stay_between_their_keys_and_angles_go_the_short_way(tmp_path_factory, opacities, azimuths):
    models = ball_models(tmp_path_factory.mktemp("balls"), "TF01")
    count = min(len(opacities), len(azimuths))
    keys = [
        {
            "azimuth": azimuth,
            "TF01.opacity": opacity,
            "light": [azimuth, 0],
            "seconds": 0.3,
            "radius": 1 + opacity,
        }
        for azimuth, opacity in zip(azimuths, opacities, strict=False)
    ]
    shown = through(Scene(models), *keys, {})
    for n in range(count - 1):
        low, high = sorted(opacities[n : n + 2])
        inside = shown[3 * n : 3 * n + 4]
        assert all(low <= scene.models["TF01"].edit.opacity <= high for _, scene in inside)
        assert all(
            1 + low <= shot.radius * (1 + 1e-12) and shot.radius <= (1 + high) * (1 + 1e-12)
            for shot, _ in inside
        )
        for angles in ([shot.azimuth for shot, _ in inside], [scene.light.azimuth for _, scene in inside]):
            steps = (np.diff(angles) + 180) % 360 - 180
            assert abs(steps.sum()) <= 180 + 1e-6
            assert (steps >= -1e-6).all() or (steps <= 1e-6).all()


def test_a_film_turns_from_the_azimuth_that_a_scene_begins_with(scene):
    """Where the first key names none."""
    framed = replace(scene, frame=replace(scene.framed(scene.open()), azimuth=10.0))
    seen = [shot.azimuth for shot, _ in through(framed, {"seconds": 0.2}, {"azimuth": 50})]
    assert seen == pytest.approx([10, 30, 50])


def test_texts_of_markers_are_those_of_the_keys(scene):
    markers = [{"points": [[0, 0, 0]], "text": "heiß 😀"}]
    _, (_, shown) = through(scene, {"seconds": 0.1}, {"markers": markers})
    assert [each.text for each in shown.markers] == ["heiß 😀"]


@pytest.mark.parametrize("kind", [str, Path])
def test_keys_are_of_a_file_or_a_sequence(tmp_path, kind):
    (tmp_path / "k.yaml").write_text("- azimuth: 3\n- azimuth: 4\n")
    given = Film(keys=kind(tmp_path / "k.yaml")).keys, Film(keys=({"azimuth": 3}, {"azimuth": 4})).keys
    assert [[each.azimuth for each in keys] for keys in given] == [[3, 4], [3, 4]]
    refused(lambda: Film(keys=[{}, {}], what="light"), "film: expected keys or a path, got keys and light")


def test_colours_go_straight_through_oklab_from_the_fitted_one(scene):
    """And so does the background."""
    keys = ({"seconds": 1}, {"low.palette": "#00ff00", "background": "#000000"})
    shown = [each for _, each in through(scene, *keys)]
    fitted = dict(zip(scene.models, scene.open().palettes, strict=True))["low"]
    for start, end, color in (
        (fitted, (0, 1, 0), lambda each: each.models["low"].edit.palette),
        ((1, 1, 1), (0, 0, 0), lambda each: each.background),
    ):
        ends = oklab(torch.tensor([start, end], dtype=torch.float64))
        found = oklab(torch.tensor([color(each) for each in shown], dtype=torch.float64))
        expected = torch.lerp(*ends, torch.linspace(0, 1, 11, dtype=torch.float64)[:, None])
        torch.testing.assert_close(found, expected, atol=2e-3, rtol=0)


def test_planes_boxes_and_functions_move(scene):
    """A function by its points, a box by its corners; a plane along its normal."""
    low, high = (
        {"opacity": [[a, 0.0], [a + 0.2, b]], "color": [[0.0, 1.0, b, 0.0]]}
        for a, b in ((0.1, 0.2), (0.3, 1.0))
    )
    cuts = {"planes": [{"normal": [0, 1, 0]}], "box": {"low": [-1, -1, -1], "high": [1, 1, 0]}}
    start = {"functions": {"new": low}, "cuts": cuts}
    end = {"functions": {"new": high}, "cut.box": "-1,-1,-1,1,1,0.2", "cut.1": "y,0.1"}
    middle = through(scene, {**start, "seconds": 1}, end)[5][1]
    np.testing.assert_allclose(middle.functions["new"].opacity, [(0.2, 0.0), (0.4, 0.6)])
    np.testing.assert_allclose(middle.functions["new"].color, [(0.0, 1.0, 0.6, 0.0)])
    assert middle.cuts.box.high == [1, 1, 0.1]
    assert middle.cuts.planes[0].normal == [0, 1, 0]
    assert middle.cuts.planes[0].offset == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("before", "after", "shown"),
    [
        ({}, {"low.visible": False}, lambda scene: scene.models["low"].edit.visible),
        ({}, {"light": [30, 40]}, lambda scene: scene.light == HEADLIGHT),
        (
            {"light": [30, 40]},
            {"light": "headlight"},
            lambda scene: scene.light == Light("directional", 30, 40),
        ),
        ({"cut": "x,0"}, {"cut.1": "y,0.1"}, lambda scene: scene.cuts.planes[0].offset == 0),
        ({"cut": "x,0"}, {"cut": "y,0.1"}, lambda scene: len(scene.cuts.planes) == 1),
    ],
)
def test_what_cannot_be_between_changes_at_its_key(scene, before, after, shown):
    holds = [shown(each) for _, each in through(scene, {**before, "seconds": 0.5}, after)]
    assert holds == [True] * 5 + [False]


def test_time_steps_through_a_series(tmp_path):
    models, series = ball_models(tmp_path, "TF01"), Series(tmp_path / "series.json", list("abcde"), ["TF01"])
    fitted = models["TF01"].open()[0]
    for number in range(5):
        write_step(series.model("TF01", number), fitted, fitted, {})
    write_series(series)
    scene = replace(Scene(models), series=series).at(0)
    shown = through(scene, {"time": 4, "seconds": 0.8}, {"time": 0})
    assert [each.time for _, each in shown] == [4, 4, 3, 2, 2, 2, 1, 0, 0]
    assert all(each.models["TF01"].step == series.model("TF01", each.time) for _, each in shown)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "k.yaml: expected a list of two keys or more, got None"),
        ("- azimuth: 3", "k.yaml: expected a list of two keys or more, got "),
        ("azimuth: 3", "k.yaml: expected a list of two keys or more, got {'azimuth': 3}"),
        ("- [", "k.yaml: expected YAML, got a mistake in line 1"),
        ("- {}\n- 3", "k.yaml: key 2: a key: expected a table of keys and values, got 3"),
        ("- {}\n- azimut: 3", "k.yaml: key 2: a key: no such key 'azimut', did you mean azimuth"),
        ("- azimuth: east\n- {}", "k.yaml: key 1: azimuth: expected a number, got 'east'"),
        ("- seconds: 0\n- {}", "k.yaml: key 1: seconds: expected more than 0, got 0"),
        ("- {}\n- polar: 91", "k.yaml: key 2: polar: expected degrees from -90 to 90, got 91"),
        ("- {}\n- TF03.opacity: 1", "k.yaml: key 2: TF03.opacity=1: expected a model of the scene"),
        (
            "- {}\n- TF01.opacty: 1",
            "key 2: TF01.opacty=1: models.TF01: no such key 'opacty', did you mean opacity",
        ),
        ("- cut: x,9\n- {}", "k.yaml: key 1: cut=x,9: expected a cut through the models"),
        ("- time: 3\n- {}", "k.yaml: key 1: time=3: time: expected a scene of a series"),
        ("- seconds: 5000\n- {}", "seconds: expected at most 100000 frames, got"),
    ],
)
def test_what_is_wrong_with_keys_is_told_with_its_place(tmp_path, capsys, text, message):
    scene, file = write_balls(tmp_path), tmp_path / "k.yaml"
    file.write_text(text)
    assert main(["render", str(scene), "--film", str(file), "--output", str(tmp_path / "x.mp4")]) == 2
    said = capsys.readouterr().err
    assert message in said
    assert len(said.splitlines()) == 1
    assert not (tmp_path / "x.mp4").exists()


def test_a_film_through_keys_has_its_own_length_and_movement(tmp_path, capsys):
    keys = turns(0, 90)
    refused(lambda: Film(keys=keys, frames=3), "frames: expected a number of frames or of seconds, or keys")
    scene = write_balls(tmp_path)
    (tmp_path / "k.yaml").write_text(yaml.safe_dump(keys))
    words = [
        "render",
        str(scene),
        "--film",
        str(tmp_path / "k.yaml"),
        "--width",
        "32",
        "--fps",
        "2",
        "--output",
    ]
    assert main([*words, str(tmp_path / "x"), "--path", "orbit"]) == 2
    assert "--film: expected no --path, got orbit" in capsys.readouterr().err
    assert main([*words, str(tmp_path / "x.gif")]) == 0
    texgs.open(scene).film(tmp_path / "y.gif", keys=keys, width=32, fps=2)
    assert (tmp_path / "x.gif").read_bytes() == (tmp_path / "y.gif").read_bytes()
    with Image.open(tmp_path / "x.gif") as film:
        assert film.n_frames == 3
