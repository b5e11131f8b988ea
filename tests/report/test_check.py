"""How far a scene is from its volume: the floor as its proof says, and what is drawn at random."""

import json
from collections import Counter
from dataclasses import replace
from math import floor
from pathlib import Path

import av
import numpy as np
import pytest
from PIL import Image

from tests.fields.surfels.test_composition import CAMERA
from tests.refusals import refused
from tests.scene.balls import balls_in_a_volume
from texgs.cli.main import main
from texgs.core.cuts import Cuts, Plane
from texgs.core.lens import Lens
from texgs.core.light import Light
from texgs.metrics.quality import compare
from texgs.report.check import LIT_SHARE, check, floor_of, found_sentence, random_shots
from texgs.scene.cut_view import scene_and_volume
from texgs.scene.scene import Scene
from texgs.scene.scene_file import write_scene
from texgs.scene.twin import Twin

LENS = Lens(3.0, 30.0, 32, 32)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return balls_in_a_volume(tmp_path_factory.mktemp("scene"))


def test_the_floor_is_an_order_statistic():
    values = list(range(64, 0, -1))
    assert floor_of(values) == 3
    assert floor_of(values[:19]) == min(values[:19])
    refused(lambda: floor_of(values[:18]), "views: expected at least 19, got 18")


def test_new_values_reach_the_floor():
    """Of uniform values the share above a floor is 1 - floor; over draws of 64 it is Beta(62, 3)."""
    draws = np.random.default_rng(3).random((4000, 64))
    shares = 1 - np.array([floor_of(each.tolist()) for each in draws])
    assert shares.mean() == pytest.approx(62 / 65, abs=0.002), "0.95 at least; 5 standard errors"
    assert (shares >= 0.9).mean() > 0.95, "1 - P(binomial(64, 0.1) < 3) = 0.961"
    ties = np.random.default_rng(4).integers(0, 5, (4000, 65))
    assert np.mean([each[-1] >= floor_of(each[:-1].tolist()) for each in ties]) > 0.95


def test_views_lights_and_edits_are_drawn_from_a_seed(scene):
    drawn = list(random_shots(scene, LENS, 400, 5))
    assert [title for title, *_ in drawn] == [title for title, *_ in random_shots(scene, LENS, 400, 5)]
    assert drawn[0][0] != next(random_shots(scene, LENS, 1, 6))[0]
    kinds = Counter(changed.light.kind for *_, changed in drawn)
    assert kinds["directional"] / 400 == pytest.approx(LIT_SHARE, abs=0.1)
    edits = [model.edit for *_, changed in drawn for model in changed.models.values()]
    assert np.mean([edit.palette is not None for edit in edits]) == pytest.approx(0.5, abs=0.1)
    assert np.mean([edit.opacity != 1 for edit in edits]) == pytest.approx(0.5, abs=0.1)
    heights = [float(camera.position[1]) / LENS.radius for _, camera, _ in drawn]
    assert np.abs(np.quantile(heights, [0.25, 0.5, 0.75]) - [-0.5, 0, 0.5]).max() < 0.15, "evenly"


def test_lights_that_are_drawn_have_the_shadows_of_the_scene(scene):
    plain = [changed for *_, changed in random_shots(scene, LENS, 20, 5)]
    shadowed = replace(scene, light=Light("directional", 1.0, 2.0, 0.7, 0.5, 0.3))
    drawn = [changed for *_, changed in random_shots(shadowed, LENS, 20, 5)]
    assert {replace(each.light, kind="headlight", azimuth=0, polar=0) for each in drawn} == {
        Light("headlight", shadows=0.7, occlusion=0.5, reach=0.3)
    }
    assert [(one.light.kind, one.edits) for one in drawn] == [(one.light.kind, one.edits) for one in plain]
    lit = [(one.light, other.light) for one, other in zip(drawn, plain, strict=True)]
    assert all(one.direction(CAMERA).equal(other.direction(CAMERA)) for one, other in lit)


def test_a_check_with_shadows_says_so(scene, tmp_path):
    shadowed = replace(scene, light=Light("headlight", shadows=1.0))
    twin, composed = Twin(scene), scene.open()
    plain, other = (
        check(each, composed, twin, LENS, 19, 7, tmp_path / "worst.json") for each in (scene, shadowed)
    )
    assert "(views from anywhere, lights and edits at random)" in plain.sentence
    assert "(views from anywhere, lights with shadows and edits at random)" in other.sentence
    assert other.psnr != plain.psnr


def test_a_check_tells_what_its_views_have(scene, tmp_path):
    twin, composition = Twin(scene), scene.open()
    result = check(scene, composition, twin, LENS, 19, 7, tmp_path / "worst.json")
    views = [compare(*scene_and_volume(composition, *x[1:], twin)) for x in random_shots(scene, LENS, 19, 7)]
    psnr = [each["psnr"] for each in views]
    assert result.psnr["mean"] == pytest.approx(np.mean(psnr))
    assert result.psnr["worst"] == result.psnr["floor"] == min(psnr)
    assert result.object_psnr["worst"] == min(each["object_psnr"] for each in views)
    assert result.shown["worst"] == min(each["shown"] for each in views)
    at_least = {name: floor(10 * min(each[name] for each in views)) / 10 for name in ("object_psnr", "psnr")}
    first, rest = result.sentence.split(" in 95 of 100 such views, ")
    assert first == f"At least {at_least['object_psnr']:.1f} dB on the object from direct volume rendering"
    there = floor(1000 * min(each["shown"] for each in views)) / 10
    assert rest.startswith(f"of the whole picture {at_least['psnr']:.1f} dB, and {there:.1f} % of what it")
    assert (tmp_path / "worst.png").stat().st_size > 5000


def test_a_cut_changes_nothing_about_a_check(scene, tmp_path):
    """Where it is cut the scene shows its volume, which is no model of it."""
    cut = replace(scene, cuts=Cuts([Plane((0.0, 0.0, 1.0), 0.0)]))
    assert cut.shows_volume
    twin, composition = Twin(scene), scene.open()
    one, other = (check(x, composition, twin, LENS, 19, 7, tmp_path / "c.json") for x in (scene, cut))
    assert one == other


def test_the_verb_writes_numbers_and_a_picture(scene, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_scene("ball.yaml", scene)
    write_scene("old.yaml", replace(scene, volume=None))
    write_scene("cut.yaml", replace(scene, cuts=Cuts([Plane((0.0, 0.0, 1.0), 0.0)])))
    words = ["--views", "19", "--width", "24", "--seed", "2"]
    assert main(["check", "ball.yaml", *words]) == 0
    told = json.loads((tmp_path / "ball-check.json").read_text())
    assert told["sentence"] in capsys.readouterr().out
    assert (told["views"], told["seed"], told["width"], told["height"]) == (19, 2, 24, 24)
    assert (tmp_path / "ball-check.png").exists()
    assert found_sentence(Path("ball.yaml"), scene) == told["sentence"], "here"
    frames = ["--width", "200", "--path", "orbit", "--frames", "2"]
    assert main(["render", "ball.yaml", "--width", "200", "--caption", "--output", "ball.png"]) == 0
    for name in ("turn.gif", "turn.mp4"):
        assert main(["render", "ball.yaml", *frames, "--output", name]) == 0
    with Image.open("ball.png") as picture, Image.open("turn.gif") as gif, av.open("turn.mp4") as film:
        found = picture.info["Comment"], gif.info["comment"].decode(), film.metadata["comment"]
        assert picture.height > picture.width == 200
    assert set(found) == {told["sentence"]}
    assert main(["check", "cut.yaml", *words]) == 0
    assert "cut.yaml: its cuts are left out, as their faces show the volume" in capsys.readouterr().err
    other = Scene({"low": scene.models["low"]})
    assert found_sentence(Path("ball.yaml"), other) == "", "of other models"
    write_scene("other.yaml", other)
    assert main(["render", "other.yaml", "--caption"]) == 2
    assert "run texgs check other.yaml first" in capsys.readouterr().err
    for file, more, named in (
        ("ball.yaml", ["--views", "18", "--output", "none.json"], "views: "),
        ("old.yaml", ["--output", "none.json"], "old.yaml: volume: "),
        ("ball.yaml", ["--output", "none.txt"], "none.txt"),
        ("ball.yaml", ["--output", "ball.yaml/x.json"], "cannot write"),
    ):
        assert main(["check", file, *more]) == 2
        assert named in capsys.readouterr().err, "before any view"
    assert not list(tmp_path.glob("none*"))


def test_what_a_check_has_found_holds_for_its_shadows(scene, tmp_path):
    """Whatever the direction of the light, which a check draws at random."""
    light = Light("directional", 10, 20, shadows=0.7, occlusion=0.4, reach=0.2)
    dark, twin, composition = replace(scene, light=light), Twin(scene), scene.open()
    result = check(dark, composition, twin, LENS, 19, 7, tmp_path / "ball-check.json")
    views = [compare(*scene_and_volume(composition, *x[1:], twin)) for x in random_shots(dark, LENS, 19, 7)]
    assert result.psnr["mean"] == pytest.approx(np.mean([each["psnr"] for each in views]))
    path = tmp_path / "ball.yaml"
    for same in (light, light.turned(90, 10), replace(light, kind="headlight")):
        assert found_sentence(path, replace(scene, light=same)) == result.sentence
    for other in (light.unhidden, replace(light, shadows=0.6), replace(light, reach=0.3)):
        assert found_sentence(path, replace(scene, light=other)) == ""
