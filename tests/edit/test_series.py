"""A series from files to a scene of all steps: what comes of it, what is made only once, and mistakes."""

import os
from dataclasses import replace
from pathlib import Path
from shutil import copytree, rmtree

import nibabel
import numpy as np
import pytest
import torch
import yaml

import texgs
from tests.fitting.short_fits import shorten
from tests.refusals import refused
from tests.volume.dicom_files import write_series as write_slices
from tests.volume.test_motion import TF, blob
from tests.volume.zarr_files import axes_of, write_image
from texgs.cli.main import main
from texgs.core.camera import orbit
from texgs.core.image import read_rgba
from texgs.core.io import write_json
from texgs.edit.series import make_series, moments_of
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.model_file import write_model
from texgs.fields.surfels.variants import write_texture
from texgs.fitting import casting, series
from texgs.fitting.now import fit_now
from texgs.scene.scene import Scene, SceneModel, SceneVolume
from texgs.scene.scene_file import read_scene, write_scene
from texgs.scene.segment_file import write_segment
from texgs.scene.session import Session
from texgs.volume.caster import Caster
from texgs.volume.framing import frame_of
from texgs.volume.moments import in_time, matching
from texgs.volume.nrrd_file import open_grid
from texgs.volume.prepare import prepare
from texgs.volume.render import Appearance
from texgs.volume.settings import VolumeKeys, open_field
from texgs.volume.slabs import ArraySource
from texgs.volume.sources import open_source
from texgs.volume.summaries import read_summaries

pytestmark = pytest.mark.stages

CPU = torch.device("cpu")
PLACES = [-0.06, 0.0, 0.06]  # of a ball, along x


def write_steps(folder, places=PLACES):
    files = []
    for index, place in enumerate(places):
        files.append(folder / f"step_{index + 8}.nrrd")  # 8, 9, 10
        prepare(ArraySource(blob((place, 0, 0))), files[-1])
    return files


@pytest.fixture(scope="module")
def fitted():
    with pytest.MonkeyPatch.context() as patch:
        shorten(patch, frequency=2, surfels=800, iterations=80)
        grid = blob((0, 0, 0))
        lens = frame_of(grid, [TF]).lens(width=96, height=96)
        return list(fit_now(Caster(grid, Appearance()), Appearance(), TF, lens, "ball"))[-1]


def begin(folder, model):
    """Three steps, and a scene of the middle one."""
    files = write_steps(folder)
    (folder / "volume.nrrd").write_bytes(files[1].read_bytes())
    file = write_model(folder / "ball.safetensors", model)
    scene = Scene({"ball": SceneModel(file)}, volume=SceneVolume(folder / "volume.nrrd", {"ball": TF}))
    write_scene(folder / "scene.yaml", scene)


@pytest.fixture(scope="module")
def followed(fitted, tmp_path_factory):
    """The folder of a scene whose series was made by the command, with short fits."""
    begin(folder := tmp_path_factory.mktemp("series"), fitted)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setattr(casting, "FREQUENCY", 2)
        for name, value in {"VIEW_SIZE": 32, "ROUNDS": 1}.items():
            patch.setattr(series, name, value)
        assert main(["series", "scene.yaml", "--files", "step_*.nrrd", "--output", "s"]) == 0
    return folder


@pytest.fixture
def whole(followed, tmp_path, monkeypatch):
    """A copy of it."""
    copytree(followed, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


class Unmoved:
    """A follower whose models stay where they are; it keeps the titles of its steps."""

    titles: list[str]

    def __init__(self, *_):
        pass

    def step(self, model, before, after, title, *_):
        self.titles.append(title)
        return model


@pytest.fixture
def folder(tmp_path, monkeypatch, fitted):
    """A folder of three steps and a scene of the middle one, whose series takes no time."""
    monkeypatch.setattr("texgs.edit.series.Follower", Unmoved)
    monkeypatch.setattr(Unmoved, "titles", [], raising=False)
    begin(tmp_path, fitted)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def made(folder):
    files = [folder / f"step_{number}.nrrd" for number in (8, 9, 10, 11)]
    there = [file for file in files if file.exists()]
    return read_scene(make_series(read_scene(folder / "scene.yaml"), there, folder / "s", CPU))


def centre(scene):
    return float(scene.models["ball"].open()[0].parameters["means"][:, 0].median())


def test_a_command_makes_a_scene_of_all_steps(whole):
    scene = read_scene("s/scene.yaml")
    assert (scene.time, list(scene.series.steps)) == (1, ["step_8.nrrd", "step_9.nrrd", "step_10.nrrd"])
    assert scene.frame.radius > frame_of(blob((0, 0, 0)), [TF]).radius + 0.03
    for time, place in enumerate(PLACES):
        assert centre(scene.at(time)) == pytest.approx(place, abs=0.02)
    assert main(["edit", "s/scene.yaml", "time=2", "ball.opacity=0.5", "--output", "s/late.yaml"]) == 0
    late = read_scene("s/late.yaml")
    assert (late.time, late.models["ball"].edit) == (2, PartEdit(opacity=0.5))
    assert yaml.safe_load((whole / "s" / "late.yaml").read_text())["series"] == "series.json"


@pytest.mark.parametrize(("path", "turn"), [("time", 0), ("orbit-time", 120)])
def test_a_film_shows_one_step_after_another(whole, path, turn):
    film = ["render", "s/scene.yaml", "--path", path, "--width", "32", "--frames", "3", "--polar", "0"]
    assert main([*film, "--output", "film"]) == 0
    scene = texgs.open(whole / "s")
    for number, file in enumerate(sorted((whole / "film").iterdir())):
        scene.time = number
        shown = np.asarray(scene.render(30 + turn * number, 0, 32))
        assert np.array_equal(read_rgba(file)[..., :3], shown)
    assert main([*film, "--compare", "--output", "beside"]) == 0


def test_what_is_there_is_not_made_again_and_what_is_missing_is(folder):
    made(folder)
    files = {file: file.read_bytes() for file in (folder / "s").iterdir()}
    (folder / "s" / "ball-00002.safetensors").unlink()
    (folder / "s" / "volume-00000.nrrd").unlink()
    Unmoved.titles.clear()
    made(folder)
    assert Unmoved.titles == ["ball, step 2"]
    assert {file: file.read_bytes() for file in (folder / "s").iterdir()} == files


def test_segments_textures_and_edits_of_one_step_hold_for_all(whole, fitted):
    scene, folder = read_scene("s/scene.yaml"), whole
    session = Session(scene.at(2))
    mask = fitted.parameters["means"][:, 1] > 0
    session.make_segment("ball/top", mask, folder / "top.safetensors", {})
    p = fitted.parameters
    look = replace(fitted, parameters={**p, "texels": 0 * p["texels"], "colors": 0 * p["colors"] + 0.1})
    session.set_file("ball/top", "texture", write_texture(folder / "look.safetensors", look))
    session.save(folder / "s" / "edited.yaml")
    edited = read_scene(folder / "s" / "edited.yaml")
    for time in range(3):
        model, (top,) = edited.at(time).models["ball"].open()
        assert torch.equal(top, mask)
        assert torch.equal(model.parameters["colors"][mask], look.parameters["colors"][mask])
        assert not torch.equal(model.parameters["colors"][~mask], look.parameters["colors"][~mask])
    camera = orbit(20, 10, 4, 30, 16, 16)
    frames = [session.frame(camera, scene=edited.at(time)) for time in range(3)]
    assert not np.array_equal(frames[0], frames[2])
    assert [file.name for file in edited.at(0).as_fitted.models["ball"].files if file] == [
        "ball.safetensors",
        "ball-00000.safetensors",
    ]


def test_a_segment_that_was_made_before_the_series_holds_in_it(folder, fitted):
    scene = read_scene(folder / "scene.yaml")
    file = write_segment(folder / "old.safetensors", fitted, fitted.parameters["means"][:, 1] > 0)
    session = Session(scene)
    session.add_segment("ball/top", file)
    write_scene(folder / "scene.yaml", session.scene)
    scene = made(folder)
    for time in range(3):
        assert len(scene.at(time).models["ball"].open()[1]) == 1


def test_the_volume_is_prepared_as_that_of_the_scene_was(folder):
    """The workflow's record says how: here each second sample."""
    results = folder / "results"
    for index, file in enumerate(write_steps(folder)):
        prepare(ArraySource(blob((PLACES[index], 0, 0), sizes=(80, 72, 64))), file)
    volume = results / "balls" / "volume" / "volume.nrrd"
    volume.parent.mkdir(parents=True)
    prepare(ArraySource(blob((0, 0, 0), sizes=(80, 72, 64))), volume, reduce=2)
    write_json(volume.with_name("metrics.json"), {"config_sha": "abc"})
    (results / ".conf").mkdir()
    (results / ".conf" / "volume-abc.yaml").write_text("volume: {file: x.nrrd, reduce: 2}\n")
    scene = read_scene(folder / "scene.yaml")
    write_scene(folder / "scene.yaml", replace(scene, volume=replace(scene.volume, file=volume)))
    assert made(folder).time == 1


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (
            lambda f: [(f / f"step_{n}.nrrd").unlink() for n in (8, 10)],
            "two files at least, got .*step_9.nrrd",
        ),
        (lambda f: (f / "step_10.nrrd").rename(f / "step_11.nrrd"), "a file each 1, got none between step_9"),
        (
            lambda f: prepare(ArraySource(blob((0, 0, 0), sizes=(20, 20, 20))), f / "step_10.nrrd"),
            r"step_10.nrrd: expected \(40, 36, 32\) samples",
        ),
        (lambda f: (f / "step_10.nrrd").write_bytes(b"NRRD0004\n"), "step_10.nrrd: "),
        (
            lambda f: (f / "step_9.nrrd").write_bytes((f / "step_8.nrrd").read_bytes()),
            "one of them to be the vol",
        ),
    ],
)
def test_mistakes_are_told_by_their_file(folder, spoil, message):
    spoil(folder)
    refused(lambda: made(folder), message)
    assert not (folder / "s" / "scene.yaml").exists()


def test_a_folder_of_another_series_and_damaged_steps_are_refused(folder, capsys):
    scene = made(folder)
    for time in (3, 1.5):
        refused(lambda time=time: scene.at(time), f"time: expected the number of a step, 0 to 2, got {time}")
    refused(lambda: read_scene("scene.yaml").at(0), "expected a scene of a series, got one without")
    step = folder / "s" / "ball-00002.safetensors"
    step.write_bytes(step.read_bytes()[:-9])
    refused(scene.at(2).open, r"models.ball: .*ball-00002.safetensors: ")
    refused(lambda: made(folder), r"ball-00002.safetensors: .*cut short or damaged")
    (folder / "step_10.nrrd").unlink()
    refused(lambda: made(folder), "expected a folder of these files, got one of others")
    assert main(["series", "scene.yaml", "--files", "none_*.nrrd", "--output", "s"]) == 2
    assert "--files: expected files that are there, got none_*.nrrd" in capsys.readouterr().err


def test_a_file_or_folder_that_has_changed_is_refused(folder):
    made(folder)
    prepare(ArraySource(blob((0.1, 0, 0))), folder / "step_10.nrrd")
    os.utime(folder / "step_10.nrrd", (0, 0))  # as a copy that keeps its time
    refused(lambda: made(folder), r"^step_10.nrrd: .*ball-00002.safetensors is of another")
    files = [folder / name for name in ("visit_1", "visit_2", "visit_3")]
    for file, place in zip(files, PLACES, strict=True):
        write_dicom(file, place)
    prepare(open_source(files[1]), folder / "volume.nrrd")
    make_series(read_scene("scene.yaml"), files, folder / "t", CPU)
    write_dicom(files[2], PLACES[0])  # a folder does not change with what is in its files
    again = lambda: make_series(read_scene("scene.yaml"), files, folder / "t", CPU)  # noqa: E731
    refused(again, r"^visit_3: .*ball-00002.safetensors is of another")


def test_names_with_brackets_are_files_before_they_are_patterns(tmp_path):
    (folder := tmp_path / "d[1]").mkdir()
    for name in ("s[0].nrrd", "s[1].nrrd", "s0.nrrd", "s1.nrrd"):
        (folder / name).touch()
    named = [folder / "s[0].nrrd", folder / "s[1].nrrd"]
    assert matching([*named, named[0]]) == named, "each is there once"
    assert [file.name for file in matching([folder / "s?.nrrd"])] == ["s0.nrrd", "s1.nrrd"]


def test_another_scene_of_the_folder_is_not_replaced(folder):
    scene, files = read_scene("scene.yaml"), matching(["step_*.nrrd"])
    before = (folder / "scene.yaml").read_bytes()
    refused(lambda: make_series(scene, files, folder, CPU), "a folder for the series, got another scene")
    (results := folder / "results").mkdir()
    (results / "metrics.json").touch()
    refused(lambda: make_series(scene, files, results, CPU), "got a result of the workflow")
    assert (folder / "scene.yaml").read_bytes() == before


def test_nifti_of_a_scene_from_python_is_read_as_it_is_told(folder, capsys):
    for number, file in enumerate(sorted(folder.glob("step_*.nrrd"))):
        values = open_grid(file).values.transpose(2, 1, 0)  # x, y, z
        nibabel.save(nibabel.Nifti1Image(values, np.eye(4)), folder / f"visit_{number}.nii")
    volume = texgs.Volume(folder / "visit_1.nii", folder=folder / "middle")
    scene = read_scene(folder / "scene.yaml")
    write_scene(folder / "own.yaml", replace(scene, volume=replace(scene.volume, file=volume.file)))
    words = ["own.yaml", "--files", "visit_*.nii", "--output", "t"]
    assert main(["series", *words]) == 2
    assert "or say how that volume was read, such as up=+z or reduce=2" in capsys.readouterr().err
    assert main(["series", *words, "up=+q"]) == 2
    assert "up: expected one of" in capsys.readouterr().err
    assert main(["series", "own.yaml", "up=+z", *words[1:]]) == 0
    assert len(read_scene(folder / "t" / "scene.yaml").series.steps) == 3


@pytest.mark.parametrize(
    "names",
    [
        ("t_0.5.nrrd", "t_1.nrrd", "t_1.5.nrrd"),
        ("t_0.0", "t_0.25", "t_0.5"),
        ("0.5/p.vti", "1/p.vti", "1.5/p.vti"),
        ("run3.9.nii.gz", "run3.10.nii.gz", "run3.11.nii.gz"),
        ("jet.t5.nrrd", "jet.t10.nrrd"),
        ("/a/s1.nrrd", "/b/s2.nrrd"),  # they share only the root
    ],
)
def test_times_are_in_order_with_decimals_and_without(names):
    files = [Path("/a", name) for name in sorted(names)]
    assert [moment.name for moment in in_time(files)] == list(names)


def test_a_step_that_is_missing_among_times_with_decimals_is_told():
    files = [Path("/a", name) for name in ("t_0", "t_0.5", "t_2")]
    refused(lambda: in_time(files), r"a file each 0\.5, got none between t_0\.5 and t_2;")


def test_python_moves_through_time_and_saves_all_steps(whole):
    scene = texgs.open(whole / "s")
    assert scene.time == 1  # that of the scene that it follows
    places = []
    for scene.time in range(3):
        places.append(centre(scene.session.scene))
    assert places == sorted(places)
    scene.save(whole / "kept")
    (whole / "kept").rename(whole / "moved")
    rmtree(whole / "s")
    (whole / "ball.safetensors").unlink()
    again = texgs.open(whole / "moved")
    assert again.time == 2
    for again.time in range(3):
        shown = again.session.scene
        assert centre(shown) == places[again.time]
        assert shown.volume.file.is_relative_to(whole / "moved")
        assert sum(read_summaries(shown.volume.file)[""]["histogram"]) == 40 * 36 * 32
        assert np.asarray(again.render(width=24, mode="volume")).std() > 1


def write_dicom(folder, place, **tags):
    """A ball as 16-bit slices."""
    folder.mkdir(parents=True, exist_ok=True)
    grid = blob((place, 0, 0))
    lattice = {"places": [(0, 0, 2 * z) for z in range(grid.dims[2])], "PixelSpacing": [1.5, 1]}
    write_slices(
        folder, np.round(1e4 * grid.values), RescaleSlope=1e-4, RescaleIntercept=0, **lattice, **tags
    )


def dated(folder):
    """Names with dates, which are not evenly apart, and a file of such a name, which is no folder."""
    for name, place in zip(("2025-11-30", "2026-01-02", "2026-01-09"), PLACES, strict=True):
        write_dicom(folder / f"visit_{name}", place)
    (folder / "visit_notes.txt").write_text("none")


def nested(folder):
    for visit, place in zip((2, 10, 18), PLACES, strict=True):
        write_dicom(folder / f"visit_{visit}" / "ct", place)


def files(folder):
    (folder / "run").mkdir()
    for file in folder.glob("step_*.nrrd"):
        file.rename(folder / "run" / file.name)


def array(folder):
    """One file with an axis of time."""
    values = np.stack([blob((place, 0, 0)).values for place in PLACES])
    scale = [1, *blob((0, 0, 0)).spacing[::-1]]
    write_image(folder / "all.zarr", [values], axes_of("tzyx", unit=""), [scale])


@pytest.mark.parametrize(
    ("write", "patterns", "names"),
    [
        (dated, ["visit_*/"], ["visit_2025-11-30", "visit_2026-01-02", "visit_2026-01-09"]),
        (nested, ["visit_10/*", "visit_2/*", "visit_18/*"], ["visit_2/ct", "visit_10/ct", "visit_18/ct"]),
        (files, ["run"], ["step_8.nrrd", "step_9.nrrd", "step_10.nrrd"]),
        (array, ["all.zarr"], [f"all.zarr, step {time}" for time in range(3)]),
    ],
)
def test_steps_may_lie_in_files_and_folders_or_along_the_time_of_one(folder, write, patterns, names):
    write(folder)
    given, keys = matching(patterns), VolumeKeys()
    (middle,) = [moment for moment in moments_of(given, keys) if moment.name == names[1]]
    prepare(open_field(replace(keys, time=middle.time or 0), middle.file), folder / "volume.nrrd")
    scene = read_scene(make_series(read_scene("scene.yaml"), given, folder / "s", CPU))
    assert (scene.time, [*scene.series.steps]) == (1, names)
    for time, place in enumerate(PLACES):
        values = open_grid(scene.at(time).volume.file).values.astype(float)
        expected = blob((place, 0, 0)).values
        np.testing.assert_allclose(values - values.min(), expected - expected.min(), atol=2e-4)
