"""Slices of the volume that the server sends, and what it says of places."""

import io
import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from tests.scene.balls import balls_in_a_volume, write_balls
from tests.scene.test_twin import HIGH, LOW
from tests.viewer.pages import TOKEN, on_page
from tests.viewer.test_messages import VALUES
from texgs.core.errors import ArgumentError
from texgs.scene.scene import SceneVolume
from texgs.scene.scene_file import write_scene
from texgs.scene.session import Session
from texgs.viewer.messages import Place, Slice, parse
from texgs.viewer.server import Server
from texgs.viewer.shared_edits import open_scene
from texgs.viewer.slices import Slices
from texgs.volume.grid import Grid
from texgs.volume.label_masks import HALF, INSIDE, MaskSource
from texgs.volume.nrrd_file import open_grid
from texgs.volume.prepare import prepare, prepare_channels
from texgs.volume.slabs import ArraySource
from texgs.volume.space import RAS, Space
from texgs.volume.transfer import TransferFunction

SHAPE = (5, 9, 7)  # z, y, x
SPACING, ORIGIN = (2.0, 1.0, 3.0), (-10.0, 4.0, 20.0)
SAMPLES = np.random.default_rng(3).integers(0, 256, SHAPE, dtype=np.uint8)
NEAR = 0.03  # world units: less than half of any step between samples
SAMPLES[0, 0], SAMPLES[-1, -1] = 0, 255  # ends of the window that slices have at first
EVERYTHING = [0, 255]  # grey levels are the samples themselves
NAMES = "sagittal", "coronal", "axial"
# Radiologists see a patient from the left, the front and the feet.
EXPECTED = {
    ("sagittal", 2): SAMPLES[::-1, ::-1, 2],
    ("coronal", 8): SAMPLES[::-1, 8, ::-1],
    ("axial", 0): SAMPLES[0, ::-1, ::-1],
}


def with_patient(folder):
    """A volume of samples in the space of a patient, with functions."""
    space = Space.along(np.eye(3), RAS, "mm")
    prepare(ArraySource(Grid(SAMPLES, SPACING, ORIGIN, space=space)), folder / "patient.nrrd")
    functions = {"low": LOW.scaled(0, 255), "high": HIGH.scaled(0, 255)}
    return SceneVolume(folder / "patient.nrrd", functions)


def point_of(index):
    """The point of the world of a sample: the longest side has length 1, and its middle is the origin."""
    counts = np.array(SHAPE[::-1])
    return (np.array(index) - (counts - 1) / 2) * SPACING / max((counts - 1) * SPACING)


def write_patient_scene(folder):
    """Balls that claim to be a volume of a patient."""
    volume = with_patient(folder)
    scene = replace(balls_in_a_volume(folder), volume=volume, space=open_grid(volume.file).world)
    return write_scene(folder / "scene.yaml", scene)


@pytest.fixture
def scene_file(tmp_path):
    return write_patient_scene(tmp_path)


async def get(client, path, name, query):
    """Status and bytes of what is asked for."""
    async with client.get(f"/{TOKEN}/{path}", params={name: json.dumps(query)}) as answer:
        return answer.status, await answer.read()


async def slice_of(client, **query):
    status, png = await get(client, "slice.png", "slice", {"window": EVERYTHING, **query})
    assert status == 200, png
    return np.asarray(Image.open(io.BytesIO(png)))


async def place_at(client, point):
    status, text = await get(client, "place.json", "place", {"point": point})
    assert status == 200, text
    return json.loads(text)


@on_page
async def test_slices_are_the_samples_of_the_file(client):
    for (plane, number), samples in EXPECTED.items():
        shown = await slice_of(client, plane=NAMES.index(plane), number=number)
        assert np.array_equal(shown, samples), plane


@on_page
async def test_a_window_goes_from_black_to_white(client):
    shown = await slice_of(client, plane=2, number=0, window=[100, 200])
    samples = EXPECTED["axial", 0].astype(float)
    assert np.abs(shown - ((samples - 100) * 2.55).clip(0, 255)).max() <= 1
    assert set(shown[samples <= 100]) == {0}
    assert set(shown[samples >= 200]) == {255}


@on_page
async def test_a_place_has_the_nearest_sample_of_the_file(client):
    for index in np.random.default_rng(4).integers(0, SHAPE[::-1], (20, 3)):
        x, y, z = index.tolist()
        found = await place_at(client, (point_of(index) + NEAR).tolist())
        assert found["index"] == [x, y, z]
        assert found["position"] == pytest.approx(
            [o + n * s for o, n, s in zip(ORIGIN, index, SPACING, strict=True)]
        )
        assert found["value"] == SAMPLES[z, y, x]
    assert await place_at(client, [0.9, 0, 0]) is None


@on_page
async def test_the_greeting_has_the_planes_and_a_window(client):
    facts = client.server_side.greeting()["scene"]["slices"]
    assert [(plane["name"], plane["count"]) for plane in facts["planes"]] == [
        ("sagittal", 7),
        ("coronal", 9),
        ("axial", 5),
    ]
    assert list(facts["window"]) == EVERYTHING


AXIAL = {"plane": 2, "number": 0, "window": EVERYTHING}


@pytest.mark.parametrize(
    ("path", "query", "message"),
    [
        ("slice.png", {**AXIAL, "plane": 3}, "plane: expected at most 2, got 3"),
        ("slice.png", {**AXIAL, "number": 5}, "slice: expected axial from 0 to 4, got 5"),
        ("slice.png", {**AXIAL, "number": -1}, "slice: expected axial from 0 to 4, got -1"),
        ("slice.png", {**AXIAL, "number": "a"}, "number: expected an integer, got 'a'"),
        ("slice.png", {"number": 0}, "plane: expected a value, got none"),
        ("slice.png", {**AXIAL, "window": [0, 1e300]}, "window: expected a finite number, got 1e+300"),
        ("slice.png", [], "message: expected keys with values in JSON, got a list"),
        ("place.json", {"point": [0, 0]}, "point: expected 3 values, got 2"),
        ("place.json", {"type": "view"}, "type: expected one of place, got 'view'"),
    ],
)
@on_page
async def test_a_mistake_is_told_in_a_sentence(client, path, query, message):
    status, text = await get(client, path, path.split(".")[0], query)
    assert (status, text.decode()) == (400, message)


@on_page
async def test_what_the_scene_has_not_is_told(client, scene_file):
    session = client.server_side.edits.session
    session.scene.volume.file.unlink()
    status, text = await get(client, "place.json", "place", {"point": [0, 0, 0]})
    assert status == 400
    assert "patient.nrrd: no such file" in text.decode()


def test_labels_lie_over_slices_in_the_colours_that_they_have_now(tmp_path):
    scene, numbers = balls_in_a_volume(tmp_path), (SAMPLES > 200).astype(np.uint8)
    image, labels = (ArraySource(Grid(each, SPACING)) for each in (SAMPLES, numbers))
    prepare_channels([image, MaskSource(labels, 1, "bright")], tmp_path / "labels.nrrd")
    palette = tuple(map(float, Session(scene).composition.palettes[1]))
    label = TransferFunction(((HALF, 0.9), (INSIDE, 0.9)), ((HALF, *palette),), channel=1)
    volume = SceneVolume(tmp_path / "labels.nrrd", {**scene.volume.tfs, "high": label})
    session = Session(replace(scene, volume=volume))
    slices, inside = Slices(session), numbers[2, ::-1].astype(bool)
    grey = np.repeat(SAMPLES[2, ::-1, :, None], 3, axis=-1)

    def shown():
        png = slices.png(Slice(2, 2, (0, 255)))
        return np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(int)

    session.change("high", "palette", "#ff0000")
    seen, mixed = shown(), 0.4 * grey[inside] + 0.6 * np.array([255, 0, 0])
    assert np.abs(seen[inside] - mixed).max() <= 1
    assert np.array_equal(seen[~inside], grey[~inside])
    session.change("high", "visible", False)
    assert np.array_equal(shown(), grey)
    for index in np.ndindex(SHAPE):
        found = slices.found(Place(tuple(point_of(index[::-1]))))
        assert found["labels"] == (("high",) if numbers[index] else ())
        assert found["value"] == SAMPLES[index]


def test_a_scene_that_names_no_volume_has_no_slices(tmp_path):
    assert Server(open_scene(write_balls(tmp_path))).greeting()["scene"]["slices"] is None


@pytest.mark.parametrize("kind", [Slice, Place])
@given(st.dictionaries(st.sampled_from(["type", "plane", "number", "window", "point"]), VALUES))
def test_nothing_else_is_raised_by_what_is_asked_for(kind, values):
    try:
        parse(json.dumps(values), kind)
    except ArgumentError as error:
        assert len(str(error)) < 2100  # noqa: PT017  one sentence, of bounded length
