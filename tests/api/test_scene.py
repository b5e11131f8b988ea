"""Scenes in Python: values of parts, looks, pictures, files, and what a cell of a notebook shows."""

import base64
import html
import io
import re

import numpy as np
import pytest
import pyvista
from PIL import Image

import texgs
from tests.refusals import refused
from tests.scene.balls import ball_models, balls_in_a_volume, write_balls
from texgs.cli.main import main
from texgs.core.errors import DeviceError
from texgs.core.image import read_rgba
from texgs.core.light import Light
from texgs.edit.new_segment import new_segment
from texgs.fields.surfels.step_file import write_step
from texgs.scene.scene import Scene as Seen
from texgs.scene.scene_file import read_scene, write_scene
from texgs.scene.series_file import Series, write_series
from texgs.viewer.standalone import scene_page


@pytest.fixture(autouse=True)
def quick(monkeypatch, tmp_path_factory):
    """Few and small views and no weights, wherever the tests run."""
    monkeypatch.setattr("texgs.edit.new_look.VIEWS", 12)
    monkeypatch.setattr("texgs.edit.new_look.SIDE", 96)
    monkeypatch.setenv("TEXGS_WEIGHTS", str(tmp_path_factory.mktemp("none")))
    monkeypatch.setenv("TEXGS_CACHE", str(tmp_path_factory.mktemp("cache")))


@pytest.fixture
def scene(tmp_path):
    return texgs.open(write_balls(tmp_path))


def pixels(scene, **view):
    return np.asarray(scene.render(width=48, **view)).astype(int)


# ---- Values -----------------------------------------------------------------


def test_values_of_parts_are_those_of_the_scene_file(scene, tmp_path):
    part = scene["TF01"]
    part.opacity, part.palette, part.visible = 0.4, "#ff8000", False
    edit = read_scene(scene.session.save(tmp_path / "edited.yaml")).models["TF01"].edit
    assert (edit.opacity, edit.visible) == (0.4, False)
    assert edit.palette == pytest.approx((1, 128 / 255, 0))
    assert (part.opacity, part.visible) == (0.4, False)
    part.palette = None
    assert scene["TF01"].palette is None
    assert scene.undo()
    assert scene["TF01"].palette is not None
    assert scene.redo()
    assert scene["TF01"].palette is None
    assert not scene.redo()


def test_light_background_and_cuts(scene):
    scene.light = (30, 40)
    scene.background = "#000000"
    assert scene.light == Light("directional", 30.0, 40.0)
    assert scene.background == (0.0, 0.0, 0.0)
    assert pixels(scene)[0, 0].tolist() == [0, 0, 0]
    scene.reach = 0.3
    scene.light = "headlight"
    assert scene.light == Light("headlight", reach=0.3)
    scene.reach = None
    assert scene.reach == 0.25
    assert scene.edit("cut=x,0", "TF02.opacity=2") is scene
    assert len(scene.session.scene.cuts.planes) == 1
    assert scene["TF02"].opacity == 2


def test_shadows_are_values_of_the_scene(tmp_path):
    scene = texgs.open(write_scene(tmp_path / "scene.yaml", balls_in_a_volume(tmp_path)))
    scene.light = (30, 40)
    plain = pixels(scene)
    scene.shadows, scene.occlusion = np.float32(0.75), 0.5
    assert (scene.shadows, scene.occlusion) == (0.75, 0.5)
    assert pixels(scene).sum() < plain.sum()
    scene.light = (60, 40)
    assert scene.light == Light("directional", 60.0, 40.0, 0.75, 0.5)
    scene.light = Light("directional", 30.0, 40.0)
    assert (pixels(scene) == plain).all(), "a whole light has shadows of its own"
    assert scene.undo()
    scene.shadows = scene.occlusion = None
    assert scene.light == Light("directional", 60.0, 40.0)


@pytest.mark.parametrize(
    ("slip", "named"),
    [
        (lambda scene: scene[0], r"model of the scene \(TF01, TF02\), got 0"),
        (lambda scene: scene.edit(["light=30,40"]), "words: "),
        (lambda scene: scene.edit("TF01.specular=0.5", "TF01.opacity=-3"), r"TF01\.opacity=-3: "),
        (lambda scene: setattr(scene, "light", (3, 4, 5)), "light: "),
        (lambda scene: setattr(scene, "shadows", -1), "light.shadows: expected a share from 0 to 1, got -1"),
        (lambda scene: setattr(scene, "occlusion", 1), "light: expected the volume of the scene"),
        (lambda scene: scene.segment("spot", [1, 2, 3], model="TF01"), "point: "),
        (
            lambda scene: scene.segment("spot", (24, 24), size=48),
            "model: expected one of TF01, TF02, got none",
        ),
        (lambda scene: scene.style("glass", recipe="preview", parts="TF03"), r"edit.parts: .* got TF03"),
        (lambda scene: scene.style("glass", recipe="preview", parts=3), "parts: "),
        (lambda scene: scene.style("glass", patern=2), "image.patern: .* did you mean pattern"),
        (lambda scene: scene.style("glass", pattern=-1), "image.pattern: "),
        (lambda scene: scene.style(np.zeros((4, 4, 3))), "picture: .* of float64"),
        (lambda scene: scene.instruct(3), "instruction: "),
        (lambda scene: scene.render(width=8.5), "width: "),
        (lambda scene: scene.psnr(views=0), "views: "),
        (lambda scene: scene.psnr(), "volume: expected the volume that the scene was made from"),
        (lambda scene: scene.film("x.mp4", "test", frames=1), "frames: "),
        (lambda scene: scene.film("x.mp4", "spin"), "what: "),
        (lambda scene: scene.export("x.html", volume="big"), "volume: "),
        (lambda scene: scene.export("x.html", steps="one"), "steps: expected a series in time"),
        (lambda scene: texgs.open("nowhere.yaml"), "nowhere.yaml: no such scene"),
    ],
)
def test_a_slip_names_what_is_wrong_and_changes_nothing(scene, tmp_path, monkeypatch, slip, named):
    monkeypatch.chdir(tmp_path)
    refused(lambda: slip(scene), named)
    assert scene["TF01"].specular == 1.0
    assert not scene.session.past
    assert not [*tmp_path.glob("x.*")]


def test_names_that_nothing_has_are_errors_of_python(scene, tmp_path):
    for owner in (scene, scene["TF01"]):
        with pytest.raises(AttributeError):
            owner.opactiy = 0.5
    with pytest.raises(AttributeError, match="has no attribute 'opne'"):
        texgs.opne  # noqa: B018
    with pytest.raises(TypeError, match="unexpected keyword argument 'with'"):
        scene.render(**{"with": 200})
    refused(lambda: texgs.open(tmp_path, device="gpu"), "device: ", DeviceError)


def test_a_scene_is_a_list_of_its_parts(scene, tmp_path):
    assert repr(scene) == "Scene\n  TF01: as fitted\n  TF02: as fitted"
    assert list(scene) == ["TF01", "TF02"]
    assert len(scene) == 2
    assert texgs.open(tmp_path / "TF01.safetensors").parts == ["TF01"]


def test_a_look_that_was_saved_and_undone_is_gone(tmp_path):
    scene = texgs.open(write_balls(tmp_path))
    scene.style("glass", recipe="preview", parts="TF01").save(tmp_path)
    assert repr(scene).endswith("a look\n  TF02: as fitted")
    before = pixels(scene)
    scene.style("dots", recipe="preview", parts="TF01").save(tmp_path)
    assert not np.array_equal(pixels(scene), before)
    assert scene.undo()
    assert np.array_equal(pixels(scene), before)


# ---- Pictures ---------------------------------------------------------------


def test_a_picture_is_that_of_texgs_render(scene, tmp_path):
    scene.light = (80, 10)
    file = scene.session.save(tmp_path / "lit.yaml")
    words = ["--azimuth", "50", "--polar", "-10", "--width", "40", "--height", "30", "--fov", "25"]
    assert main(["render", str(file), *words, "--output", str(tmp_path / "a.png")]) == 0
    picture = scene.render(50, -10, 40, 30, fov_y=25)
    assert np.array_equal(np.asarray(picture), read_rgba(tmp_path / "a.png")[..., :3])
    near = scene.render(50, -10, 40, 30, radius=1.5, target=(0.1, 0, 0), mode="normal", transparent=True)
    words = ["--radius", "1.5", "--target", "0.1", "0", "0", "--mode", "normal", "--transparent", *words[:-2]]
    assert main(["render", str(file), *words, "--output", str(tmp_path / "b.png")]) == 0
    assert np.array_equal(np.asarray(near), read_rgba(tmp_path / "b.png"))


def test_a_slice_is_that_of_texgs_render(tmp_path):
    scene = texgs.open(write_scene(tmp_path / "scene.yaml", balls_in_a_volume(tmp_path)))
    words = ["--slice", "z=12", "--width", "90", "--output", str(tmp_path / "a.png")]
    assert main(["render", str(tmp_path / "scene.yaml"), *words]) == 0
    assert np.array_equal(np.asarray(scene.slice("z", 12, width=90)), read_rgba(tmp_path / "a.png")[..., :3])


def test_films_have_the_frames_of_pictures(scene, tmp_path):
    folder = scene.film(tmp_path / "turn", frames=3, width=32)
    frames = [read_rgba(folder / f"{number:04}.png")[..., :3] for number in range(3)]
    for number, frame in enumerate(frames):
        assert np.array_equal(frame, np.asarray(scene.render(30 + 120 * number, 20, 32)))
    films = [scene.film(tmp_path / f"{what}.gif", what, frames=2, width=32) for what in ("orbit", "light")]
    assert films[0].read_bytes() != films[1].read_bytes(), "one of them turns the light"


# ---- Looks ------------------------------------------------------------------


def test_a_style_is_one_step_that_can_be_undone(scene):
    before = pixels(scene)
    scene.style(Image.new("CMYK", (50, 40), (0, 255, 255, 0)), recipe="preview", parts=["TF01"])  # red
    styled = pixels(scene)
    assert (styled - before)[..., 0].max() > 30
    assert scene.session.scene.models["TF02"].texture is None
    scene.undo()
    assert np.array_equal(pixels(scene), before)


def test_an_instruction_by_filters(scene):
    before = pixels(scene)
    scene.instruct("make it gold", guidance="filters", recipe="quick", size=64)
    assert np.abs(pixels(scene) - before).max() > 30
    assert scene.session.past == ["TF01, TF02 make it gold"]


def test_a_click_makes_a_part(scene):
    part = scene.segment("spot", (24, 24), model="TF01", size=48, views=12, masks="grabcut")
    assert part.name == "TF01/spot"
    assert "TF01/spot" in scene.parts
    part.palette = "#00ff00"
    assert scene.session.scene.models["TF01"].segments["spot"].edit.palette == (0, 1, 0)


def test_edits_that_a_page_makes_meanwhile_stay(scene, monkeypatch):
    def meanwhile(*arguments, **options):
        scene["TF02"].opacity = 0.25
        return new_segment(*arguments, **options)

    monkeypatch.setattr("texgs.edit.new_segment.new_segment", meanwhile)
    scene.segment("spot", (24, 24), model="TF01", size=48, views=12, masks="grabcut")
    assert scene["TF02"].opacity == 0.25


# ---- Files ------------------------------------------------------------------


def test_a_saved_scene_needs_nothing_else(tmp_path):
    scene = texgs.open(write_balls(tmp_path))
    scene.style("glass", recipe="preview", parts=["TF01"])
    scene.segment("spot", (24, 24), model="TF02", size=48, views=12, masks="grabcut").opacity = 0.3
    expected = pixels(scene)
    folder = tmp_path / "kept"
    file = scene.save(folder)
    assert scene.save(folder) == file  # onto itself, from elsewhere
    moved = folder.rename(tmp_path / "moved")
    for path in tmp_path.glob("*.safetensors"):
        path.unlink()
    del scene
    again = texgs.open(moved)
    assert np.array_equal(pixels(again), expected)
    assert again.save(moved) == moved / "scene.yaml"  # in place
    assert np.array_equal(pixels(texgs.open(moved)), expected)


def test_exports_by_their_endings(scene, tmp_path):
    page = scene.export(tmp_path / "a.html")
    assert page.read_text() == scene_page(scene.session.scene, "a").text
    assert scene.export(tmp_path / "a.ply", "points", opacity=0.0).read_bytes().startswith(b"ply")


def test_polygons_for_paraview_are_those_of_pyvista(scene, tmp_path):
    scene["TF02"].visible = False
    written, mesh = pyvista.read(scene.export(tmp_path / "a.vtp")), scene.to_pyvista()
    assert np.array_equal(written.points, mesh.points)
    assert np.array_equal(written.cell_data["rgba"], mesh.cell_data["rgba"])
    assert main(["export", str(scene.save(tmp_path / "s")), "--to", str(tmp_path / "b.vtp")]) == 0
    assert np.array_equal(pyvista.read(tmp_path / "b.vtp").points, mesh.points)


# ---- Notebooks --------------------------------------------------------------


def test_a_cell_has_the_page_itself_and_a_picture(scene):
    shown = scene._repr_mimebundle_()
    source = re.fullmatch(r'<iframe srcdoc="([^"]*)".*', shown["text/html"], re.DOTALL)[1]
    assert html.unescape(source) == scene_page(scene.session.scene, "TF01, TF02").text
    assert Image.open(io.BytesIO(base64.b64decode(shown["image/jpeg"]))).size == (512, 512)
    assert re.fullmatch(r"[\d,]+ surfels; \d+\.\d MB of this notebook", shown["text/plain"])


def test_a_large_page_is_a_picture_that_says_so(scene):
    shown = scene.show(largest=0.01)._repr_mimebundle_()
    assert shown["text/html"].startswith(f'<img src="data:image/jpeg;base64,{shown["image/jpeg"]}">')
    assert "scene.show(largest=" in shown["text/plain"]


def test_a_page_holds_the_steps_of_a_series_or_one(tmp_path):
    models = ball_models(tmp_path, "TF01")
    key, series = models["TF01"].open()[0], Series(tmp_path / "series.json", ["a", "b"], ["TF01"])
    for time in range(2):
        write_step(series.model("TF01", time), key, key, {})
    write_series(series)
    scene = texgs.open(write_scene(tmp_path / "scene.yaml", Seen(models, series=series).at(1)))
    assert [scene.show(steps=steps).text.count('class="step"') for steps in ("all", "one", 1)] == [2, 1, 2]
    assert (
        scene.export(tmp_path / "x.html", steps="one").read_text()
        == scene_page(scene.session.scene, "x", steps="one").text
    )


# ---- Numbers of NumPy, steps and options --------------------------------------


def test_numbers_of_numpy_are_numbers(scene, tmp_path):
    part = scene["TF01"]
    part.opacity, part.specular, part.shininess = np.float64(0.5), np.float32(0.25), np.int64(2)
    part.palette = np.array([0.1, 0.2, 0.3])
    scene.light = np.array([10, 20])
    scene.background = (np.float32(0.5), np.float64(0.5), 1)
    again = texgs.open(scene.save(tmp_path / "copy"))
    edit = again.session.scene.models["TF01"].edit
    assert (edit.opacity, edit.specular, edit.shininess, edit.palette) == (0.5, 0.25, 2, (0.1, 0.2, 0.3))
    assert again.light == Light("directional", 10.0, 20.0)
    assert again.background == (0.5, 0.5, 1.0)


def test_words_are_one_step_or_none(scene):
    scene.edit("TF01.opacity=0.7", "light=10,20", "background=#000000")
    assert len(scene.session.past) == 1
    scene.undo()
    assert (scene["TF01"].opacity, scene.light, scene.background) == (
        1.0,
        Light("headlight"),
        (1.0, 1.0, 1.0),
    )
    refused(lambda: scene.edit("TF01.opacity=-3"), "TF01.opacity")
    assert scene.redo()  # a word that is wrong takes nothing from the history
    assert scene["TF01"].opacity == 0.7
    scene.edit()
    assert len(scene.session.past) == 1
