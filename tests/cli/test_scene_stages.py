"""Compose, edit and time a scene of two basic models, from the volume on, by hand."""

import json
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from tests.cli.conftest import ORBITAL, numbers
from texgs.cli.main import main
from texgs.core.camera import orbit
from texgs.core.image import read_rgba, to_pillow
from texgs.metrics.quality import compare
from texgs.report.check import found_sentence
from texgs.scene.cut_view import scene_and_volume
from texgs.scene.scene_file import read_scene, write_scene
from texgs.scene.twin import Twin
from texgs.volume.view_set import read_views

pytestmark = pytest.mark.stages


@pytest.fixture(scope="module")
def results(at, scene_of_two):
    """The scene, edited by numbers and timed."""
    at(
        scene_of_two.parent,
        ["pse", *ORBITAL],
        ["timing", *ORBITAL],
    )
    return scene_of_two / "orbital" / "scene" / "demo"


def test_the_scene_has_all_models_and_a_picture(results):
    scene = read_scene(results / "compose" / "scene.yaml")
    assert list(scene.models) == ["TF01", "TF02"]
    assert len(scene.open()) == numbers(results / "compose")["primitives"]
    picture, truth = (
        np.asarray(Image.open(results / "compose" / f"{name}.png").convert("RGB")).astype(float)
        for name in ("scene", "volume")
    )
    assert picture.min() < 200, "there is something to see"
    assert abs(picture - truth).mean() < 0.5 * (255 - truth).mean(), "the volume is seen from the same side"


def test_the_twin_of_the_scene_is_what_the_views_show(results):
    scene = read_scene(results / "compose" / "scene.yaml")
    views = read_views(results.parents[1] / "TF02" / "views").test
    alone = replace(scene, models={"TF02": scene.models["TF02"]}, background=(0.0, 0.0, 0.0))
    for view in views:
        seen = Twin(alone).render(view.camera, replace(alone, light=view.light), [()])
        assert np.array_equal(to_pillow(seen.color, seen.alpha), read_rgba(view.path))


def test_a_view_beside_its_volume(results, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    path, size = results / "compose" / "scene.yaml", ["--width", "48", "--radius", "2.5", "--azimuth", "10"]
    assert main(["render", str(path), "--compare", "--gain", "8", *size, "--output", "c.png"]) == 0
    scene = read_scene(path)
    told = compare(*scene_and_volume(scene.open(), orbit(10, 20, 2.5, 30, 48, 48), scene, Twin(scene)))
    assert capsys.readouterr().out.startswith(
        f"PSNR on the object {told['object_psnr']:.2f} dB, SSIM {told['object_ssim']:.4f}, "
        f"whole picture: {told['psnr']:.2f} dB"
    )
    height, width, _ = np.asarray(Image.open("c.png")).shape
    assert width > 2 * height
    film = [*size, "--path", "orbit", "--frames", "2", "--output", "film.gif"]
    assert main(["render", str(path), "--compare", *film]) == 0
    assert main(["edit", str(path), "cut=x,0", "--output", "cut.yaml"]) == 0
    assert main(["render", "cut.yaml", "--compare", *size]) == 2
    assert "got a cut one that shows its volume; take cuts back" in capsys.readouterr().err
    assert main(["render", "cut.yaml", "--compare", "fitted", *size, "--output", "c.png"]) == 0
    assert main(["edit", str(path), "cut=x,0", "--output", str(path.with_name("mine.yaml"))]) == 2
    assert "is a result of the workflow, which makes it anew" in capsys.readouterr().err
    old = write_scene("old.yaml", replace(scene, volume=None))
    assert main(["render", str(old), "--compare", "--output", "none.png"]) == 2
    assert "old.yaml: volume: expected the volume that the scene was made from" in capsys.readouterr().err
    assert not (tmp_path / "none.png").exists()


def test_what_an_edit_changed_of_a_view(results, tmp_path, monkeypatch, capsys):
    """Colours alone, and the opacity of one model; pixels are counted from frames of `Scene.open`."""
    monkeypatch.chdir(tmp_path)
    scene, size = str(results / "compose" / "scene.yaml"), ["--width", "48", "--azimuth", "10"]
    for words, told in (
        ("TF02.palette=#cc2211", "; depth, normal, opacity: bit for bit as fitted"),
        ("light=30,40", "colours differ by 0.000 at most; depth, normal, opacity: bit for bit as fitted"),
        ("TF01.opacity=0.5", None),
    ):
        assert main(["edit", scene, words, "--output", "edited.yaml"]) == 0
        assert main(["render", "edited.yaml", "--compare", "fitted", *size, "--output", "c.png"]) == 0
        said = capsys.readouterr().out
        if told is None:
            edited = read_scene("edited.yaml")
            camera = orbit(10, 20, *edited.framed().lens(30.0, 48, 48))
            now = edited.open().render(camera, edits=edited.edits)
            before = read_scene(scene).open().render(camera)
            told = f"{int((now.alpha != before.alpha).sum())} pixels have another opacity"
        assert told in said


def test_fits_tell_which_views_they_are_of_and_what_their_data_stand_in_for(results):
    phases = [results.parents[1] / "TF01" / "demo" / phase for phase in ("shading", "texture")]
    for folder in (*phases, results / "pse"):
        assert json.loads((folder / "metrics.json").read_text())["stand_in"] == "vortex"
    for folder in phases:
        metrics = numbers(folder)
        assert (metrics["train_views"], metrics["width"], metrics["height"]) == (12, 48, 48)


def test_edits_are_compared_with_the_volume(results):
    metrics = numbers(results / "pse")
    titles = [step["title"] for step in metrics["pse"]]
    assert titles[:3] == ["as fitted", "+ opacity of TF01 x 0.4", "+ other colours"]
    assert titles[3:] == ["+ k_a x 0.7, k_d x 1.2, k_s x 2", "+ light from the left"]
    assert len(metrics["relight"]) == 6
    assert all(step["object_psnr"] < step["psnr"] - 3 for step in metrics["pse"])
    assert all(step["psnr"] > 12 for step in (*metrics["pse"], *metrics["relight"]))
    assert metrics["pse"][0]["psnr"] > 16
    for name in ("pse.png", "relight.png", "shadows.png"):
        assert (results / "pse" / name).stat().st_size > 5000
    check, told = metrics["check"], json.loads((results / "pse" / "metrics.json").read_text())
    assert check["psnr"]["worst"] <= check["psnr"]["floor"] <= check["psnr"]["mean"]
    composed = results / "compose" / "scene.yaml"
    assert found_sentence(composed, read_scene(composed)) == check["sentence"]
    assert "in 95 of 100 such views" in told["pictures"]["check.png"]
    assert told["pictures"]["shadows.png"].startswith("Light and shadow: ")
    last = read_scene(results / "pse" / "pse-4.yaml")
    edit = last.models["TF01"].edit
    assert (edit.opacity, edit.ambient, last.light.azimuth) == (0.4, 0.7, -150.0), (
        "each edit keeps the others"
    )
    assert edit.palette is not None


def test_frames_are_timed_beside_the_volume(results):
    metrics = numbers(results / "timing")
    assert 0 < metrics["frame_mean_ms"] <= metrics["frame_max_ms"]
    assert metrics["volume_mean_ms"] > 0
    assert (metrics["width"], metrics["height"]) == (48, 48)


def test_tables_and_report_have_them(results, monkeypatch, capsys):
    monkeypatch.chdir(results.parents[3])
    assert main(["tables"]) == 0
    text = capsys.readouterr().out
    assert "opacity of TF01 x 0.4" in text
    assert "volume / scene" in text
    assert main(["report"]) == 0
    assert (results.parents[2] / "report.html").stat().st_size > 100_000


def test_the_report_needs_no_other_file_and_takes_titles_as_text(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["report"]) == 2
    assert "no whole results below results" in capsys.readouterr().err
    pse = [{"title": "a <b> edit", "psnr": 31.25, "ssim": 0.9}]
    record = {"stage": "pse", "dataset": "engine", "recipe": "quick", "variant": "", "seconds": 1.5}
    record |= {"versions": {"python": "3.11", "texgs": "1"}, "code_sha": "abc", "pictures": {}}
    numbers = {"pse": pse, "relight": [{"title": "light"}], "views": 6}
    (folder := tmp_path / "results" / "engine").mkdir(parents=True)
    (folder / "metrics.json").write_text(json.dumps({**record, "result": "PseResult", "numbers": numbers}))
    assert main(["report", str(folder / "metrics.json")]) == 0
    text = (tmp_path / "results" / "report.html").read_text()
    assert all(told in text for told in ("31.25", "a &lt;b&gt; edit", "not measured"))
    assert "http" not in text.replace("http-equiv", "")
