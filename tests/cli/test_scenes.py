"""Scenes from the command line: rendered, edited, reported."""

import json
from itertools import pairwise

import numpy as np
import pytest
import torch
import yaml
from PIL import Image

from tests.fields.gaussians.samples import sample as gaussians
from tests.fields.surfels.test_composition import ball
from tests.scene.balls import write_balls
from texgs.cli.main import main
from texgs.fields.gaussians.files import write_gaussians
from texgs.fields.surfels.model_file import write_model
from texgs.fields.surfels.variants import write_texture
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.scene_file import read_scene, write_scene
from texgs.scene.segment_file import write_segment


@pytest.fixture
def scene(tmp_path):
    """scene.yaml with two models."""
    return write_balls(tmp_path)


def test_a_model_that_does_not_go_with_the_others_is_refused_before_a_file_is_written(
    scene, tmp_path, capsys
):
    other = write_gaussians(tmp_path / "g.safetensors", gaussians())
    words = [f"TF01.file={other}", "--output", str(tmp_path / "mix.yaml")]
    assert main(["edit", str(scene), *words]) == 2
    assert "expected fields of one kind, got gaussians and surfels" in capsys.readouterr().err
    assert not (tmp_path / "mix.yaml").exists()


def render(scene, output, *words):
    return main(["render", str(scene), "--output", str(output), "--width", "40", *words])


def test_one_view_and_its_default_name(scene, tmp_path, monkeypatch):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    assert main(["render", str(scene), "--width", "40", "--height", "30"]) == 0
    assert Image.open("scene.png").size == (40, 30)


@pytest.mark.parametrize("path", ["test", "orbit", "light"])
def test_paths_are_films(scene, tmp_path, path):
    assert render(scene, tmp_path / "turn", "--path", path, "--frames", "3") == 0
    shown = [np.asarray(Image.open(tmp_path / "turn" / f"{i:04}.png")).astype(int) for i in range(3)]
    assert all(np.abs(one - other).max() > 8 for one, other in pairwise(shown))


def test_edits_show_and_are_data(scene, tmp_path):
    edited = tmp_path / "new" / "edited.yaml"
    words = [
        "TF01.palette=#ff0000",
        "TF02.visible=false",
        "TF01.diffuse=0.5",
        "light=30,-10",
        "background=0,0,0",
    ]
    assert main(["edit", str(scene), *words, "--output", str(edited)]) == 0
    result = read_scene(edited)
    assert result.models["TF01"].edit.palette == (1, 0, 0)
    assert not result.models["TF02"].edit.visible
    assert (result.light.kind, result.light.azimuth, result.light.polar) == ("directional", 30, -10)
    assert render(edited, tmp_path / "a.png") == 0
    picture = np.asarray(Image.open(tmp_path / "a.png")).astype(int)
    assert picture[0, 0].tolist() == [0, 0, 0]
    assert picture[..., 0].sum() > 1.3 * picture[..., 2].sum()
    back = tmp_path / "back.yaml"
    undo = ["TF01.palette=", "TF02.visible=", "TF01.diffuse=", "light=headlight", "background=#ffffff"]
    assert main(["edit", str(edited), *undo, "--output", str(back)]) == 0
    assert yaml.safe_load(back.read_text()) == yaml.safe_load(scene.read_text())


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("TF03.opacity=1", "TF03.opacity=1: expected a model of the scene (TF01, TF02), got TF03"),
        ("TF01.opasity=1", "TF01.opasity=1: models.TF01: no such key 'opasity', did you mean opacity?"),
        ("TF01.opacity=-1", "TF01.opacity=-1: models.TF01.opacity: expected a factor from 0 to 1000, got -1"),
        ("TF01.texture=none.safetensors", "expected a file that is there, got none.safetensors"),
        ("TF01.opacity=[", "expected a number, true, false, r,g,b or #rrggbb"),
        ("visible", "expected KEY=VALUE, such as TF01.opacity=0.5"),
    ],
)
def test_a_mistake_in_an_edit_writes_nothing(scene, tmp_path, capsys, word, message):
    assert main(["edit", str(scene), word, "--output", str(tmp_path / "x.yaml")]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "x.yaml").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--frames", "0"], "--frames: expected at least 1, got 0"),
        (["--radius", "0"], "radius: expected more than 0, got 0"),
        (["--height", "-4"], "height: expected at least 1 pixel, got -4"),
    ],
)
def test_a_mistake_in_a_rendering(scene, tmp_path, capsys, words, message):
    assert render(scene, tmp_path / "x.png", *words) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "x.png").exists()


def test_names_that_yaml_takes_for_numbers_or_that_have_dots(scene, tmp_path):
    values = yaml.safe_load(scene.read_text())
    values["models"] = {42: values["models"]["TF01"], "v1.2": values["models"]["TF02"]}
    scene.write_text(yaml.safe_dump(values))
    words = ["42.opacity=0.5", "v1.2.opacity=0.25"]
    assert main(["edit", str(scene), *words, "--output", str(tmp_path / "new.yaml")]) == 0
    assert [x.edit.opacity for x in read_scene(tmp_path / "new.yaml").models.values()] == [0.5, 0.25]


def test_a_file_is_named_from_where_one_is_and_found_through_a_link(scene, tmp_path, monkeypatch):
    (tmp_path / "styles" / "deep").mkdir(parents=True)
    write_texture(tmp_path / "styles" / "a.safetensors", ball(1))
    (tmp_path / "link").symlink_to(tmp_path / "styles" / "deep")
    monkeypatch.chdir(tmp_path / "styles")
    assert (
        main(
            ["edit", str(scene), "TF01.texture=a.safetensors", "--output", str(tmp_path / "link" / "b.yaml")]
        )
        == 0
    )
    assert render(tmp_path / "link" / "b.yaml", tmp_path / "b.png") == 0


def test_a_folder_is_no_file(scene, tmp_path, capsys):
    assert main(["edit", str(scene), "--output", str(tmp_path)]) == 2
    assert "expected the name of a file, got a folder" in capsys.readouterr().err


def test_a_gpu_that_is_not_there(scene, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    assert render(scene, tmp_path / "a.png", "--device", "cuda") == 2
    assert "torch sees no GPU" in capsys.readouterr().err


def test_report_holds_pictures_and_numbers(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["report"]) == 2
    assert "no metrics.json below results" in capsys.readouterr().err
    folder = tmp_path / "results" / "engine" / "scene" / "quick" / "pse"
    folder.mkdir(parents=True)
    Image.new("RGB", (4, 4), "red").save(folder / "pse.png")
    numbers = {
        "pse": [{"title": "a <b> edit", "psnr": 31.25, "ssim": 0.9}],
        "relight": [{"title": "light"}],
        "views": 6,
    }
    record = {"stage": "pse", "dataset": "engine", "recipe": "quick", "variant": "", "seconds": 1.5}
    versions = {"versions": {"python": "3.11", "texgs": "1"}, "code_sha": "abc"}
    pictures = {"pse.png": "Edits of colour.", "relight.png": "Not written."}
    metrics = {**record, **versions, "result": "PseResult", "numbers": numbers}
    metrics["pictures"] = pictures
    (folder / "metrics.json").write_text(json.dumps(metrics))
    assert main(["report"]) == 0
    text = (tmp_path / "results" / "report.html").read_text()
    assert "31.25" in text
    assert "a &lt;b&gt; edit" in text
    assert "not measured" in text, "the second edit was not compared"
    assert text.count('<a href="#job-1">1</a>') == 2, "rows lead to the job that they are from"
    assert text.count('<tr id="job-1">') == 1
    assert text.count("data:image/webp;base64,") == 1
    assert "http" not in text.replace("http-equiv", ""), "the report needs no other file"


@pytest.fixture
def dotted(tmp_path):
    """A scene of a model whose name has a dot, and a file with a segment of it."""
    path = write_model(tmp_path / "model.safetensors", ball(1))
    write_segment(tmp_path / "half.safetensors", ball(1), torch.arange(150) % 2 == 0)
    return write_scene(tmp_path / "scene.yaml", Scene({"v1.2": SceneModel(path)}))


def edit(dotted, *words, output="new.yaml"):
    return main(["edit", str(dotted), *words, "--output", str(dotted.with_name(output))])


def test_a_segment_is_added_edited_and_removed(dotted):
    half = dotted.with_name("half.safetensors")
    words = [f"v1.2/shell={half}", "v1.2/shell.opacity=0.5", "v1.2/shell.palette=#ff0000", "v1.2.diffuse=0.5"]
    assert edit(dotted, *words) == 0
    model = read_scene(dotted.with_name("new.yaml")).models["v1.2"]
    assert (model.edit.diffuse, model.edit.palette) == (0.5, None)
    assert (model.segments["shell"].edit.opacity, model.segments["shell"].edit.palette) == (0.5, (1, 0, 0))
    assert edit(dotted.with_name("new.yaml"), "v1.2/shell.palette=", output="next.yaml") == 0
    segment = read_scene(dotted.with_name("next.yaml")).models["v1.2"].segments["shell"]
    assert (segment.edit.opacity, segment.edit.palette) == (0.5, None)
    assert edit(dotted.with_name("next.yaml"), "v1.2/shell=", "v1.2.diffuse=", output="back.yaml") == 0
    assert yaml.safe_load(dotted.with_name("back.yaml").read_text()) == yaml.safe_load(dotted.read_text())


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("v1.2/shell.opacity=1", "expected a segment of v1.2 (it has none), got shell"),
        ("v1.2/shell=", "expected a segment of v1.2 (it has none), got shell"),
        ("TF01/shell.opacity=1", "expected a model of the scene (v1.2), got TF01"),
        ("v1.2/shell=none.safetensors", "expected a file that is there, got none.safetensors"),
        ("v1.2/=scene.yaml", "expected a file that is there"),
    ],
)
def test_a_mistake_in_an_edit_of_a_segment_writes_nothing(dotted, capsys, word, message):
    assert edit(dotted, word) == 2
    assert f"{word}: {message}" in capsys.readouterr().err
    assert not dotted.with_name("new.yaml").exists()
