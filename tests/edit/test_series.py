"""A series from files to a scene of all steps: what comes of it, what is made only once, and mistakes."""

import os
from dataclasses import replace
from pathlib import Path
from shutil import rmtree

import nibabel
import numpy as np
import pytest
import torch
import yaml
from pydicom.uid import generate_uid

import texgs
from tests.fitting.short_fits import shorten
from tests.volume.dicom_files import write_series as write_slices
from tests.volume.test_motion import TF, blob
from tests.volume.zarr_files import axes_of, write_image
from texgs.cli.main import main
from texgs.core.camera import orbit
from texgs.core.errors import ArgumentError
from texgs.core.image import read_rgba
from texgs.core.io import write_json
from texgs.edit.series import make_series, settings_of
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.model_file import write_model
from texgs.fields.surfels.variants import write_texture
from texgs.fitting import casting, series
from texgs.fitting.now import fit_now
from texgs.scene.copied import write_copy
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
from texgs.volume.settings import VolumeKeys
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


@pytest.fixture
def folder(tmp_path, monkeypatch, fitted):
    """A folder of three steps, and a scene of the middle one; fits are short."""
    monkeypatch.setattr(casting, "FREQUENCY", 2)
    for name, value in {"VIEW_SIZE": 32, "ROUNDS": 1}.items():
        monkeypatch.setattr(series, name, value)
    files = write_steps(tmp_path)
    (tmp_path / "volume.nrrd").write_bytes(files[1].read_bytes())
    file = write_model(tmp_path / "ball.safetensors", fitted)
    scene = Scene({"ball": SceneModel(file)}, volume=SceneVolume(tmp_path / "volume.nrrd", {"ball": TF}))
    write_scene(tmp_path / "scene.yaml", scene)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def made(folder):
    files = [folder / f"step_{number}.nrrd" for number in (8, 9, 10, 11)]
    there = [file for file in files if file.exists()]
    return read_scene(make_series(read_scene(folder / "scene.yaml"), there, folder / "s", CPU))


def centre(scene):
    return float(scene.models["ball"].open()[0].parameters["means"][:, 0].median())


def test_a_command_makes_a_scene_of_all_steps(folder, capsys):
    assert main(["series", "scene.yaml", "--files", "step_*.nrrd", "--output", "s"]) == 0
    assert capsys.readouterr().out.strip() == "s/scene.yaml"
    scene = read_scene("s/scene.yaml")
    assert (scene.time, list(scene.series.steps)) == (1, ["step_8.nrrd", "step_9.nrrd", "step_10.nrrd"])
    assert scene.frame.radius > frame_of(blob((0, 0, 0)), [TF]).radius + 0.03
    for time, place in enumerate(PLACES):
        assert centre(scene.at(time)) == pytest.approx(place, abs=0.02)
    assert main(["edit", "s/scene.yaml", "time=2", "ball.opacity=0.5", "--output", "s/late.yaml"]) == 0
    late = read_scene("s/late.yaml")
    assert (late.time, late.models["ball"].edit) == (2, PartEdit(opacity=0.5))
    assert yaml.safe_load((folder / "s" / "late.yaml").read_text())["series"] == "series.json"


def test_a_film_through_time_shows_a_ball_that_moves(folder):
    make = ["render", "s/scene.yaml", "--path", "time", "--width", "32", "--frames", "3", "--azimuth", "-90"]
    assert made(folder).time == 1
    assert main([*make, "--polar", "0", "--output", "film"]) == 0
    columns = []
    for file in sorted((folder / "film").iterdir()):
        shown = (read_rgba(file)[..., :3] < 250).any(axis=2)
        columns.append(np.nonzero(shown)[1].mean())
    assert columns[0] + 1 < columns[1] < columns[2] - 1
    assert main([*make, "--compare", "--output", "beside"]) == 0


def test_what_is_there_is_not_made_again_and_what_is_missing_is(folder, monkeypatch):
    made(folder)
    files = {file: file.read_bytes() for file in (folder / "s").iterdir()}
    (folder / "s" / "ball-00002.safetensors").unlink()
    (folder / "s" / "volume-00000.nrrd").unlink()
    done = []
    step = series.Follower.step
    monkeypatch.setattr(series.Follower, "step", lambda *a, **k: done.append(a[4]) or step(*a, **k))
    made(folder)
    assert done == ["ball, step 2"]
    assert {file: file.read_bytes() for file in (folder / "s").iterdir()} == files


def test_a_file_that_has_changed_is_refused(folder):
    made(folder)
    file = folder / "step_10.nrrd"
    prepare(ArraySource(blob((0.1, 0, 0))), file)
    os.utime(file, (0, 0))  # as a copy that keeps its time
    with pytest.raises(ArgumentError, match=r"^step_10.nrrd: .*ball-00002.safetensors is of another"):
        made(folder)


def test_segments_textures_and_edits_of_one_step_hold_for_all(folder, fitted):
    scene = made(folder)
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


def test_a_volume_near_the_root_is_of_no_workflow():
    assert settings_of(Path("/volume.nrrd")) == VolumeKeys()


def test_a_copy_of_the_scene_has_all_steps(folder):
    scene = made(folder)
    write_copy(folder / "copy", scene.at(2))
    (folder / "s").rename(folder / "gone")
    (folder / "copy").rename(folder / "elsewhere")
    copy = read_scene(folder / "elsewhere" / "scene.yaml")
    assert copy.time == 2
    assert centre(copy) == centre(read_scene(folder / "gone" / "scene.yaml").at(2))
    assert all(copy.at(time).volume.file.is_relative_to(folder / "elsewhere") for time in range(3))
    assert all(copy.at(time).volume.file.exists() for time in range(3))
    for time in range(3):
        summary = read_summaries(copy.at(time).volume.file)[""]
        assert sum(summary["histogram"]) == 40 * 36 * 32


def test_a_segment_that_was_made_before_the_series_holds_in_it(folder, fitted):
    scene = read_scene(folder / "scene.yaml")
    file = write_segment(folder / "old.safetensors", fitted, fitted.parameters["means"][:, 1] > 0)
    session = Session(scene)
    session.add_segment("ball/top", file)
    write_scene(folder / "scene.yaml", session.scene)
    for time in range(3):
        assert len(made(folder).at(time).models["ball"].open()[1]) == 1


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
    with pytest.raises(ArgumentError, match=message):
        made(folder)
    assert not (folder / "s" / "scene.yaml").exists()


def test_a_folder_of_another_series_and_damaged_steps_are_refused(folder):
    scene = made(folder)
    with pytest.raises(ArgumentError, match=r"time: expected the number of a step, 0 to 2, got 3"):
        scene.at(3)
    with pytest.raises(ArgumentError, match=r"time: expected the number of a step, 0 to 2, got 1\.5"):
        scene.at(1.5)
    with pytest.raises(ArgumentError, match="expected a scene of a series, got one without"):
        read_scene(folder / "scene.yaml").at(0)
    step = folder / "s" / "ball-00002.safetensors"
    step.write_bytes(step.read_bytes()[:-9])
    with pytest.raises(ArgumentError, match=r"models.ball: .*ball-00002.safetensors: "):
        scene.at(2).open()
    with pytest.raises(ArgumentError, match=r"ball-00002.safetensors: .*cut short or damaged"):
        made(folder)
    (folder / "step_10.nrrd").unlink()
    with pytest.raises(ArgumentError, match="expected a folder of these files, got one of others"):
        made(folder)


def test_no_file_of_a_pattern_is_told(folder, capsys):
    assert main(["series", "scene.yaml", "--files", "none_*.nrrd", "--output", "s"]) == 2
    assert "--files: expected files that are there, got none_*.nrrd" in capsys.readouterr().err
    assert main(["render", "scene.yaml", "--path", "time", "--output", "f.mp4"]) == 2
    assert "expected a scene of a series, got one without" in capsys.readouterr().err


def test_names_with_brackets_are_files_before_they_are_patterns(tmp_path):
    (folder := tmp_path / "d[1]").mkdir()
    for name in ("s[0].nrrd", "s[1].nrrd", "s0.nrrd", "s1.nrrd"):
        (folder / name).touch()
    named = [folder / "s[0].nrrd", folder / "s[1].nrrd"]
    assert matching(named) == named
    assert [file.name for file in matching([folder / "s?.nrrd"])] == ["s0.nrrd", "s1.nrrd"]
    assert matching([*named, named[0]]) == named, "each is there once"
    assert [file.name for file in matching([tmp_path / "d*" / "s[01].nrrd"])] == ["s0.nrrd", "s1.nrrd"]


def test_another_scene_of_the_folder_is_not_replaced(folder):
    before = (folder / "scene.yaml").read_bytes()
    with pytest.raises(ArgumentError, match="expected a folder for the series, got another scene"):
        make_series(read_scene(folder / "scene.yaml"), matching([folder / "step_*.nrrd"]), folder, CPU)
    (results := folder / "results").mkdir()
    (results / "metrics.json").touch()
    with pytest.raises(ArgumentError, match="expected a folder for the series, got a result of the workflow"):
        make_series(read_scene(folder / "scene.yaml"), matching([folder / "step_*.nrrd"]), results, CPU)
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


def test_steps_that_share_only_the_root_keep_its_slash():
    apart, beside = [Path("/a/s1.nrrd"), Path("/b/s2.nrrd")], [Path("/a/b/s1.nrrd"), Path("/a/c/s2.nrrd")]
    assert [moment.name for moment in in_time(apart)] == ["/a/s1.nrrd", "/b/s2.nrrd"]
    assert [moment.name for moment in in_time(beside)] == ["b/s1.nrrd", "c/s2.nrrd"]


@pytest.mark.parametrize(
    "names",
    [
        ("t_0.nrrd", "t_0.5.nrrd", "t_1.nrrd", "t_1.5.nrrd"),
        ("t_0.0", "t_0.25", "t_0.5", "t_0.75", "t_1.0"),
        ("0.5/p.vti", "1/p.vti", "1.5/p.vti", "2/p.vti"),
        ("run3.9.nii.gz", "run3.10.nii.gz", "run3.11.nii.gz"),
        ("t_9.5.h5", "t_10.5.h5"),
        ("jet.t5.nrrd", "jet.t10.nrrd"),
    ],
)
def test_times_with_decimals_are_in_order(names):
    files = [Path("/a", name) for name in sorted(names)]
    assert [moment.name for moment in in_time(files)] == list(names)


def test_a_step_that_is_missing_among_times_with_decimals_is_told():
    with pytest.raises(ArgumentError, match=r"a file each 0\.5, got none between t_0\.5 and t_2;"):
        in_time([Path("/a", name) for name in ("t_0", "t_0.5", "t_2")])


def test_python_moves_through_time_and_saves_all_steps(folder):
    made(folder)
    scene = texgs.open(folder / "s")
    assert scene.time == 1  # that of the scene that it follows
    places = []
    for scene.time in range(3):
        places.append(centre(scene.session.scene))
    assert places == sorted(places)
    scene.save(folder / "kept")
    (folder / "kept").rename(folder / "moved")
    rmtree(folder / "s")
    (folder / "ball.safetensors").unlink()
    again = texgs.open(folder / "moved")
    assert again.time == 2
    for again.time in range(3):
        assert centre(again.session.scene) == places[again.time]
        assert np.asarray(again.render(width=24, mode="volume")).std() > 1
    with pytest.raises(ArgumentError, match="time: expected the number of a step, 0 to 2, got 3"):
        again.time = 3


def test_one_file_has_all_steps_along_its_axis_of_time(folder):
    values = np.stack([blob((place, 0, 0)).values for place in PLACES])
    scale = [1, *blob((0, 0, 0)).spacing[::-1]]
    write_image(folder / "all.zarr", [values], axes_of("tzyx", unit=""), [scale])  # as the scene's volume
    assert main(["series", "scene.yaml", "--files", "all.zarr", "--output", "s"]) == 0
    scene = read_scene(folder / "s" / "scene.yaml")
    assert list(scene.series.steps) == ["all.zarr, step 0", "all.zarr, step 1", "all.zarr, step 2"]
    for time, place in enumerate(PLACES):
        assert centre(scene.at(time)) == pytest.approx(place, abs=0.02)


def write_dicom(folder, place, **tags):
    """A ball as 16-bit slices."""
    folder.mkdir(parents=True, exist_ok=True)
    grid = blob((place, 0, 0))
    lattice = {"places": [(0, 0, 2 * z) for z in range(grid.dims[2])], "PixelSpacing": [1.5, 1]}
    write_slices(
        folder, np.round(1e4 * grid.values), RescaleSlope=1e-4, RescaleIntercept=0, **lattice, **tags
    )


def followed(folder, *files):
    """The scene of a series, after its volume was prepared from the second of three steps."""
    assert main(["series", "scene.yaml", "--files", *files, "--output", "s"]) == 0
    scene = read_scene(folder / "s" / "scene.yaml")
    assert scene.time == 1
    for time, place in enumerate(PLACES):
        assert centre(scene.at(time)) == pytest.approx(place, abs=0.02)
    return list(scene.series.steps)


def test_folders_of_slices_are_steps(folder):
    """Their names have dates, which are not evenly apart; a file of such a name is no folder."""
    names = ["visit_2025-11-30", "visit_2026-01-02", "visit_2026-01-09"]
    for name, place in zip(names, PLACES, strict=True):
        write_dicom(folder / name, place)
    (folder / "visit_notes.txt").write_text("none")
    prepare(open_source(folder / names[1]), folder / "volume.nrrd")
    assert followed(folder, "visit_*/") == names
    rmtree(folder / "s")
    assert (
        followed(folder, *(str(folder / name) for name in names[::-1])) == names
    )  # of a shell, in any order


def test_slices_that_have_changed_are_refused(folder):
    """A folder does not change with what is in its files."""
    names = ["visit_1", "visit_2", "visit_3"]
    for name, place in zip(names, PLACES, strict=True):
        write_dicom(folder / name, place)
    prepare(open_source(folder / names[1]), folder / "volume.nrrd")
    files = [folder / name for name in names]
    make_series(read_scene("scene.yaml"), files, folder / "s", CPU)
    write_dicom(files[2], PLACES[0])
    with pytest.raises(ArgumentError, match=r"^visit_3: .*ball-00002.safetensors is of another"):
        make_series(read_scene("scene.yaml"), files, folder / "s", CPU)


def test_slices_in_folders_of_folders(folder):
    for visit, place in zip((2, 10, 18), PLACES, strict=True):
        write_dicom(folder / f"visit_{visit}" / "ct", place)
    prepare(open_source(folder / "visit_10" / "ct"), folder / "volume.nrrd")
    names = [f"visit_{visit}/ct" for visit in (2, 10, 18)]
    assert followed(folder, "visit_*/ct") == names
    (folder / "visit_18").rename(folder / "visit_26")
    with pytest.raises(ArgumentError, match="a file each 8, got none between visit_10/ct and visit_26/ct"):
        make_series(read_scene("scene.yaml"), [*folder.glob("visit_*/ct")], folder / "t", CPU)


def test_one_folder_of_slices_has_all_steps(folder):
    for step, place in enumerate(PLACES):
        write_dicom(folder / "heart", place, number=step, TriggerTime=40 * step + 20)
    prepare(open_source(folder / "heart", time=1), folder / "volume.nrrd")
    assert followed(folder, "heart") == [f"heart, step {time}" for time in range(3)]


def test_one_folder_has_a_series_for_each_phase(folder):
    for step, place in enumerate(PLACES):
        tags = {"uid": generate_uid(), "SeriesDescription": f"{50 * step}%"}
        write_dicom(folder / "lung", place, number=9 - step, **tags)
    prepare(open_source(folder / "lung", series="all", time=1), folder / "volume.nrrd")
    file = make_series(
        read_scene("scene.yaml"), [folder / "lung"], folder / "s", CPU, VolumeKeys(series="all")
    )
    scene = read_scene(file)
    assert (scene.time, [*scene.series.steps]) == (1, [f"lung, step {time}" for time in range(3)])
    for time, place in enumerate(PLACES):
        assert centre(scene.at(time)) == pytest.approx(place, abs=0.02)


def test_one_folder_of_files_has_all_steps(folder):
    (folder / "run").mkdir()
    for file in folder.glob("step_*.nrrd"):
        file.rename(folder / "run" / file.name)
    assert followed(folder, "run") == ["step_8.nrrd", "step_9.nrrd", "step_10.nrrd"]


def test_a_film_turns_while_time_passes(folder):
    made(folder)
    film = [
        "render",
        "s/scene.yaml",
        "--path",
        "orbit-time",
        "--width",
        "32",
        "--frames",
        "3",
        "--polar",
        "0",
    ]
    assert main([*film, "--output", "film"]) == 0
    scene = texgs.open(folder / "s")
    for number, file in enumerate(sorted((folder / "film").iterdir())):
        scene.time = number
        assert np.array_equal(read_rgba(file)[..., :3], np.asarray(scene.render(30 + 120 * number, 0, 32)))
