"""Scenes from the command line: rendered and edited; with words, files and models that mean harm."""

import json
import lzma
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import torch
import yaml
from PIL import Image
from safetensors.torch import save

from tests.edit.scenes import task
from tests.fields.gaussians.samples import sample as gaussians
from tests.fields.surfels.samples import sample
from tests.fields.surfels.test_composition import ball
from tests.scene.balls import balls_in_a_volume, write_balls
from texgs.cli.main import main
from texgs.core.errors import ArgumentError, OutOfMemoryError
from texgs.core.lens import Frame
from texgs.core.light import Light
from texgs.fields.gaussians import write_gaussians
from texgs.fields.surfels.compact import read_compact, write_compact
from texgs.fields.surfels.model_file import write_model
from texgs.fields.surfels.variants import write_texture
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.scene_file import read_scene, write_scene
from texgs.scene.segment_file import write_segment
from texgs.scene.session import Session
from texgs.volume.slice_keys import SliceKeys


@pytest.fixture
def scene(tmp_path):
    """scene.yaml with two models."""
    return write_balls(tmp_path)


def render(scene, output, *words):
    return main(["render", str(scene), "--output", str(output), "--width", "40", *words])


def edit(scene, *words, output="new.yaml"):
    """Write the edited scene beside the scene."""
    return main(["edit", str(scene), *words, "--output", str(scene.parent / output)])


def refused(capsys, *words):
    """What the command line says about a mistake, in one line that a terminal can show."""
    assert main([str(word) for word in words]) == 2
    message = capsys.readouterr().err.splitlines()[0]
    assert message.isprintable()
    assert message.startswith(f"texgs {words[0]}: ")
    return message


def test_a_model_file_stands_for_a_scene_of_it_alone(scene, tmp_path):
    model = read_scene(scene).models["TF02"].file
    alone = write_scene(tmp_path / "alone.yaml", Scene({model.stem: SceneModel(model)}))
    for source, name in ((model, "model.png"), (alone, "scene.png")):
        assert main(["render", str(source), "--width", "40", "--output", str(tmp_path / name)]) == 0
    pictures = [np.asarray(Image.open(tmp_path / name)) for name in ("model.png", "scene.png")]
    assert np.array_equal(*pictures)
    assert edit(model, f"{model.stem}.opacity=0.5") == 0
    assert read_scene(scene.with_name("new.yaml")).models[model.stem].edit.opacity == 0.5


def test_a_folder_is_a_scene_and_a_picture_has_a_name(scene, tmp_path, monkeypatch, capsys):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    words = [
        "--width",
        "40",
        "--height",
        "30",
        "--target",
        "-1e-3",
        "-.5",
        "-2.",
    ]  # no options
    assert main(["render", "..", *words]) == 0
    assert capsys.readouterr().out == "scene.png\n"
    assert Image.open("scene.png").size == (40, 30)


def test_a_picture_shows_the_frame_of_the_scene(scene, tmp_path):
    """Numbers make the same picture again, and place cameras elsewhere."""
    write_scene(scene, replace(read_scene(scene), frame=Frame([0.2, 0.1, 0.0], 1.0)))
    shown = {}
    for name, words in {
        "framed": [],
        "again": ["--target", "0.2", "0.1", "0", "--radius", str(Frame([0, 0, 0], 1.0).lens().radius)],
        "paper": ["--frame", "paper"],
        "origin": ["--target", "0", "0", "0", "--radius", "4.0311"],
    }.items():
        assert render(scene, tmp_path / f"{name}.png", *words) == 0
        shown[name] = np.asarray(Image.open(tmp_path / f"{name}.png")).astype(int)
    assert (shown["framed"] == shown["again"]).all()
    assert (shown["paper"] == shown["origin"]).all()
    assert np.abs(shown["framed"] - shown["paper"]).max() > 30


@pytest.mark.parametrize("path", ["test", "orbit", "light"])
def test_paths_are_films(scene, tmp_path, path):
    assert render(scene, tmp_path / "turn", "--path", path, "--frames", "3") == 0
    shown = [np.asarray(Image.open(tmp_path / "turn" / f"{i:04}.png")).astype(int) for i in range(3)]
    assert all(np.abs(one - other).max() > 8 for one, other in pairwise(shown))


def test_a_film_has_so_many_seconds(scene, tmp_path):
    words = ["--path", "orbit", "--seconds", "0.5", "--fps", "8"]
    assert render(scene, tmp_path / "turn", *words) == 0
    assert len(list((tmp_path / "turn").iterdir())) == 4
    assert render(scene, tmp_path / "turn.gif", *words) == 0
    with Image.open(tmp_path / "turn.gif") as film:
        assert film.n_frames == 4
        assert film.info["duration"] in (120, 130)


def test_colours_have_names(scene):
    assert edit(scene, "background=navy", "TF01.palette=red", "TF02.tint=Gold") == 0
    edited = read_scene(scene.with_name("new.yaml"))
    assert edited.background == (0, 0, 128 / 255)
    assert edited.models["TF01"].edit.palette == (1, 0, 0)
    assert edited.models["TF02"].edit.tint == (1, 215 / 255, 0)


def test_a_transparent_picture_over_the_background_is_the_picture(scene, tmp_path):
    assert edit(scene, "background=#204060") == 0
    edited = scene.with_name("new.yaml")
    for mode in ("shaded", "depth", "alpha"):
        assert render(edited, tmp_path / "whole.png", "--mode", mode) == 0
        assert render(edited, tmp_path / "clear.png", "--mode", mode, "--transparent") == 0
        whole, clear = (np.asarray(Image.open(tmp_path / f"{name}.png")) / 255 for name in ("whole", "clear"))
        behind = np.zeros(3) if mode == "alpha" else np.array([0x20, 0x40, 0x60]) / 255
        alpha = clear[..., 3:]
        assert clear[0, 0].tolist() == [0, 0, 0, 0]
        assert alpha.max() > 0.9
        assert np.abs(alpha * clear[..., :3] + (1 - alpha) * behind - whole).max() < 2 / 255


@pytest.mark.parametrize("axis", ["x", "-y", "0.3,0.8,-0.5"])
def test_a_plane_of_a_film_goes_through_what_is_visible(scene, tmp_path, axis):
    """It is smaller than the frame and beside its middle, and far from a model that is hidden."""
    write_model(tmp_path / "TF01.safetensors", ball(1, middle=0.6))
    write_model(tmp_path / "TF02.safetensors", ball(2, middle=-9.0))
    write_scene(scene, replace(read_scene(scene), frame=Frame([0.0] * 3, 3.0)))
    assert edit(scene, "TF02.visible=false", f"cut={axis},0.1") == 0
    assert edit(scene, "TF02.visible=false", output="whole.yaml") == 0
    assert render(tmp_path / "whole.yaml", tmp_path / "whole.png", "--width", "160") == 0
    film = ["--path", "cut", "--frames", "3", "--width", "160"]
    assert render(tmp_path / "new.yaml", tmp_path / "film", *film) == 0
    files = [tmp_path / "whole.png", *sorted((tmp_path / "film").iterdir())]
    shown = [np.asarray(Image.open(file)) for file in files]
    whole, first, middle, last = (int((picture < 230).any(2).sum()) for picture in shown)
    assert (shown[0] != shown[1]).any(), "it begins in what is visible"
    assert whole >= first > middle > last > 0.02 * whole


def test_edits_show_and_are_data(scene, tmp_path):
    edited = tmp_path / "new" / "edited.yaml"
    numbers = ["TF01.palette=#ff0000", "TF02.visible=false", "TF01.diffuse=0.5"]
    assert edit(scene, *numbers, "light=30,-10", "background=0,0,0", output="new/edited.yaml") == 0
    result = read_scene(edited)
    assert result.models["TF01"].edit.palette == (1, 0, 0)
    assert not result.models["TF02"].edit.visible
    assert (result.light.kind, result.light.azimuth, result.light.polar) == ("directional", 30, -10)
    assert render(edited, tmp_path / "a.png") == 0
    picture = np.asarray(Image.open(tmp_path / "a.png")).astype(int)
    assert picture[0, 0].tolist() == [0, 0, 0]
    assert picture[..., 0].sum() > 1.3 * picture[..., 2].sum()
    undo = ["TF01.palette=", "TF02.visible=", "TF01.diffuse=", "light=headlight", "background=#ffffff"]
    assert edit(edited, *undo, output="../back.yaml") == 0
    assert yaml.safe_load(scene.with_name("back.yaml").read_text()) == yaml.safe_load(scene.read_text())


def test_shadows_are_edits_that_can_be_taken_back(tmp_path):
    (tmp_path / "here").mkdir()
    scene = write_scene(tmp_path / "here" / "scene.yaml", balls_in_a_volume(tmp_path))
    assert edit(scene, "shadows=0.7", "occlusion=0.5", "light=30,-10", "reach=0.3", output="dark.yaml") == 0
    dark = scene.with_name("dark.yaml")
    assert read_scene(dark).light == Light("directional", 30.0, -10.0, 0.7, 0.5, 0.3)
    assert edit(dark, "shadows=", "occlusion=", "reach=", "light=") == 0
    assert scene.with_name("new.yaml").read_text() == scene.read_text()
    for words in (["--compare"], ["--compare", "fitted"], ["--path", "light", "--frames", "2"]):
        assert render(dark, tmp_path / "dark.gif", *words) == 0


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("shadows=2", "shadows=2: light.shadows: expected a share from 0 to 1, got 2"),
        ("shadows=0.5", "shadows=0.5: light: expected the volume of the scene for shadows and occlusion"),
        ("TF03.opacity=1", "expected a model of the scene (TF01, TF02), got TF03"),
        ("TF01/shell.opacity=1", "expected a segment of TF01 (it has none), got shell"),
        ("TF01/=none", "expected a file that is there"),
        ("TF01.texture=none.safetensors", "expected a file that is there, got none.safetensors"),
        ("TF01.texture=foreign", "foreign: expected a texgs-"),
        ("TF01/x=foreign", "foreign: expected a texgs-"),
        ("TF01.file=gaussians.safetensors", "expected fields of one kind, got gaussians and surfels"),
        ("TF01.opacity=[", "expected a number, true, false, r,g,b, #rrggbb or a colour's name"),
        ("TF01.palette=rde", "#rrggbb or the name of a colour, got 'rde', did you mean red?"),
        ("TF01.style=x.jpg", "a look by a picture or by words is learned: by texgs view, scene.style"),
        ("visible", "expected KEY=VALUE, such as TF01.opacity=0.5"),
    ],
)
def test_a_mistake_in_an_edit_writes_nothing(scene, tmp_path, monkeypatch, capsys, word, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "foreign").write_text("root:x:0:0")
    write_gaussians(tmp_path / "gaussians.safetensors", gaussians())
    assert message in refused(capsys, "edit", scene, word, "--output", "new.yaml")
    assert not scene.with_name("new.yaml").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--frames", "3", "--seconds", "2"], "frames: expected a number of frames or of seconds, or keys"),
        (["--transparent"], "x.mp4: expected PNG for transparent pictures, got .mp4"),
        (["--transparent", "--caption"], "--transparent: expected neither --compare nor --caption"),
        (["--path", "orbit", "--output", "x.png"], "x.png: expected one frame, got 72; use .gif, .mp4 or"),
        (["--radius", "0"], "--radius: expected more than 0, got 0"),
        (["--device", "cuda"], "torch sees no GPU"),
        (["--mode", "normal", "--width", "300000"], "a frame of 300000 x 300000 pixels: needs 5364 GiB"),
        (["--compare", "--mode", "normal"], "--compare: expected --mode shaded, got normal"),
        (["--compare", "--legend"], "--legend: expected neither --compare nor --slice"),
        (["--path", "cut"], "path cut: expected a scene that a plane cuts, got none"),
    ],
)
def test_a_mistake_in_a_rendering(scene, tmp_path, capsys, monkeypatch, words, message):
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    assert message in refused(capsys, "render", scene, "--output", tmp_path / "x.mp4", *words)
    assert not (tmp_path / "x.mp4").exists()


@pytest.mark.parametrize("shown", ["z=20", "all", "x"])
def test_a_slice_is_a_picture(tmp_path, shown):
    """That of the session, which is tested on its own; as wide as it is asked for."""
    scene = write_scene(tmp_path / "scene.yaml", balls_in_a_volume(tmp_path))
    words = ["--slice", shown, "--at", "0.1", "-.2", "0.3", "--window", "-1", "0.8"]
    assert render(scene, tmp_path / "a.png", *words, "--width", "200") == 0
    plane, _, number = shown.partition("=")
    keys = SliceKeys(plane, int(number) if number else None, (0.1, -0.2, 0.3), (-1.0, 0.8), 200)
    assert np.array_equal(np.asarray(Image.open(tmp_path / "a.png")), Session.open(scene).slices(keys))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["axial=3"], "slice: expected all, or a number of x, y, z, got axial"),
        (["z=32"], "slice: expected z from 0 to 31, got 32"),
        (["z=a"], "--slice: expected an integer, got 'a'"),
        (["z=-1"], "--slice: expected at least 0, got -1"),
        (["all", "--at", "0", "0", "99"], "at: expected a place in the volume, from"),
        (["all", "--path", "orbit"], "--slice: expected no --mode, --path, --transparent or --compare"),
        (["all", "--compare"], "--slice: expected no --mode, --path, --transparent or --compare"),
    ],
)
def test_a_mistake_in_a_slice(tmp_path, capsys, words, message):
    scene = write_scene(tmp_path / "scene.yaml", balls_in_a_volume(tmp_path))
    assert message in refused(
        capsys, "render", scene, "--output", tmp_path / "a.png", "--width", "80", "--slice", *words
    )


def test_a_slice_needs_a_volume(scene, tmp_path, capsys):
    message = refused(capsys, "render", scene, "--output", tmp_path / "a.png", "--slice", "all")
    assert "volume: expected the volume that the scene was made from, got none" in message


def test_only_a_scene_is_replaced_by_an_edited_one(scene, tmp_path, capsys):
    for name in ("data.yaml", "picture.png"):
        (file := tmp_path / name).write_text("name: engine\n")
        assert str(file) in refused(capsys, "edit", scene, "light=30,40", "--output", file)
        assert file.read_text() == "name: engine\n"
    (folder := tmp_path / "folder").mkdir()
    assert "--output: expected a file that" in refused(capsys, "edit", scene, "--output", folder)
    assert [edit(scene, f"light=30,{polar}") for polar in (40, 50)] == [0, 0]
    assert read_scene(tmp_path / "new.yaml").light.polar == 50


def test_a_missing_file_of_a_scene_is_named_with_the_scene(scene, tmp_path, capsys):
    values = yaml.safe_load(scene.read_text())
    values["cuts"] = {"planes": [{"normal": [1, 0, 0]}]}
    values["volume"] = {"file": "gone.nrrd", "tfs": {}}
    scene.write_text(yaml.safe_dump(values))
    message = refused(capsys, "render", scene, "--output", tmp_path / "x.png")
    assert message.startswith(f"texgs render: {scene}: volume: ")
    assert message.endswith("gone.nrrd: no such file; texgs volume dataset=NAME makes it")
    values["models"]["TF01"]["file"] = "gone.safetensors"
    scene.write_text(yaml.safe_dump(values))
    message = refused(capsys, "render", scene, "--output", tmp_path / "x.png")
    assert message.startswith(f"texgs render: {scene}: models.TF01: ")
    assert not (tmp_path / "x.png").exists()


def test_a_model_that_is_cut_off_is_told_before_a_file_is_written(scene, tmp_path, capsys):
    model = read_scene(scene).models["TF02"].file
    model.write_bytes(model.read_bytes()[:-100])
    message = refused(capsys, "edit", scene, "TF01.opacity=0.5", "--output", tmp_path / "new.yaml")
    assert message.startswith(f"texgs edit: {scene}: models.TF02: {model}: expected a texgs-model file, got ")
    assert not (tmp_path / "new.yaml").exists()


def test_a_file_is_named_from_where_one_is_and_found_through_a_link(scene, tmp_path, monkeypatch):
    (tmp_path / "styles" / "deep").mkdir(parents=True)
    write_texture(tmp_path / "styles" / "a.safetensors", ball(1))
    (tmp_path / "link").symlink_to(tmp_path / "styles" / "deep")
    monkeypatch.chdir(tmp_path / "styles")
    assert edit(scene, "TF01.texture=a.safetensors", output="link/b.yaml") == 0
    assert render(tmp_path / "link" / "b.yaml", tmp_path / "b.png") == 0


def test_a_segment_is_added_edited_and_removed(scene, tmp_path):
    """Of models whose names have a dot, or are numbers to YAML."""
    values = yaml.safe_load(scene.read_text())
    values["models"] = {42: values["models"]["TF01"], "v1.2": values["models"]["TF02"]}
    scene.write_text(yaml.safe_dump(values))
    half = write_segment(tmp_path / "half.safetensors", ball(2), torch.arange(150) % 2 == 0)
    words = [f"v1.2/shell={half}", "v1.2/shell.opacity=0.5", "v1.2/shell.palette=#ff0000", "v1.2.diffuse=0.5"]
    assert edit(scene, *words, "42.opacity=5e-1") == 0
    models = read_scene(tmp_path / "new.yaml").models
    assert models["42"].edit.opacity == 0.5
    assert (models["v1.2"].edit.diffuse, models["v1.2"].edit.palette) == (0.5, None)
    shell = models["v1.2"].segments["shell"].edit
    assert (shell.opacity, shell.palette) == (0.5, (1, 0, 0))
    assert edit(tmp_path / "new.yaml", "v1.2/shell.palette=", output="next.yaml") == 0
    shell = read_scene(tmp_path / "next.yaml").models["v1.2"].segments["shell"].edit
    assert (shell.opacity, shell.palette) == (0.5, None)
    back = ("v1.2/shell=", "v1.2.diffuse=", "42.opacity=")
    assert edit(tmp_path / "next.yaml", *back, output="back.yaml") == 0
    assert read_scene(tmp_path / "back.yaml") == read_scene(scene)


def test_a_name_of_a_model_is_no_way_out_of_the_folder(tmp_path):
    path = write_model(tmp_path / "m.safetensors", ball(1))
    hostile = Scene({"../../outside": SceneModel(path)})
    folder = tmp_path / "a" / "b"
    with pytest.raises(ArgumentError, match=r"edit.parts: expected a name that a file can have"):
        task(hostile, folder).each_part(lambda part, model, surfels, views: model)
    assert sorted(x.name for x in tmp_path.rglob("*.safetensors")) == ["m.safetensors"]


def test_a_compact_file_that_unpacks_to_more_than_there_is(tmp_path):
    path = write_compact(tmp_path / "m.texgs", sample())
    line = path.read_bytes().partition(b"\n")[0]
    tensors = save({"codes": torch.zeros(8, dtype=torch.uint8)})
    start = json.dumps({"codes": {"dtype": "U8", "shape": [2**50], "data_offsets": [0, 2**50]}}).encode()
    path.write_bytes(line + b"\n" + lzma.compress(len(start).to_bytes(8, "little") + start + tensors))
    with pytest.raises(
        OutOfMemoryError, match=r"m\.texgs: a model of 1125899906842624 bytes, as its header says"
    ):
        read_compact(path)
    many = save({"codes": torch.zeros(8, dtype=torch.uint8)}) + bytes(300_000_000)
    path.write_bytes(line + b"\n" + lzma.compress(many, preset=0))
    with pytest.raises(ArgumentError, match=r"got 8 bytes of tensors, expected 8|cut short or damaged"):
        read_compact(path)


def test_pictures_go_into_no_result_of_the_workflow(scene, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "metrics.json").touch()
    for verb in ("render", "check"):
        assert main([verb, "scene.yaml"]) == 2
        assert "--output: . is a result of the workflow, which makes it anew" in capsys.readouterr().err
    assert main(["export", "scene.yaml", "--to", "scene.html"]) == 2
    assert "--to: . is a result of the workflow, which makes it anew" in capsys.readouterr().err
    assert main(["render", "scene.yaml", "--path", "orbit", "--output", str(tmp_path)]) == 2
    assert f"--output: {tmp_path} is a result of the workflow" in capsys.readouterr().err
    (tmp_path / "own").mkdir()
    assert main(["render", "scene.yaml", "--width", "16", "--output", "own/a.png"]) == 0
