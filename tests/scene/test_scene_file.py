import json
from dataclasses import replace

import pytest
import torch
import yaml
from hypothesis import given
from hypothesis import strategies as st
from safetensors.torch import load_file, save_file

from tests.fields.surfels.samples import sample
from tests.fields.surfels.test_composition import CAMERA, ball
from tests.refusals import refused
from texgs.core.cuts import Box, Cuts, Plane
from texgs.core.errors import ArgumentError
from texgs.core.lens import Frame
from texgs.core.light import Light
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.model_file import write_model
from texgs.fields.surfels.variants import write_texture
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.scene_file import LIGHT_KEYS, light_of, plain_light, read_scene, write_scene


@pytest.fixture
def folder(tmp_path):
    """Two models, a texture variant of the first, and scene.yaml in a folder beside."""
    write_model(tmp_path / "a" / "model.safetensors", ball(1))
    write_model(tmp_path / "b" / "model.safetensors", ball(2))
    write_texture(tmp_path / "a" / "style.safetensors", halved(), {"style": "half"})
    return tmp_path


def halved():
    """The first model with texels that are half as large."""
    p = ball(1).parameters
    return replace(ball(1), parameters={**p, "texels": p["texels"] * 0.5})


def scene_in(folder):
    edit = PartEdit(palette=(0.1, 0.2, 0.3), opacity=0.5, tint=(1, 0.5, 0))
    style = folder / "a" / "style.safetensors"
    first = SceneModel(folder / "a" / "model.safetensors", edit, style)
    second = SceneModel(folder / "b" / "model.safetensors", PartEdit(visible=False))
    light, frame = Light("directional", 30, -10), Frame([0.1, 0.0, -0.25], 0.5)
    cuts = Cuts([Plane([3.0, 0.0, 4.0], 0.5)], Box([-0.5, -0.5, -0.5], [0.1, 0.2, 0.3]), "unlit")
    return Scene({"TF01": first, "TF02": second}, light, (0.0, 0.5, 1.0), cuts, frame=frame)


def resolved(scene):
    models = {
        name: replace(x, file=x.file.resolve(), texture=x.texture and x.texture.resolve())
        for name, x in scene.models.items()
    }
    return replace(scene, models=models)


def test_what_is_saved_is_opened(folder):
    path = write_scene(folder / "scenes" / "scene.yaml", scene_in(folder))
    assert resolved(read_scene(path)) == resolved(scene_in(folder))
    values = yaml.safe_load(path.read_text())
    edited = {"file": "../b/model.safetensors", "visible": False}
    assert values["models"]["TF02"] == edited, "nothing else is edited"


NUMBERS = st.floats(0, 1)


@given(
    light=st.builds(
        Light,
        *(st.just("directional"), st.floats(-1e6, 1e6), st.floats(-90, 90)),
        shadows=NUMBERS,
        occlusion=NUMBERS,
        reach=st.floats(1e-3, 2),
    )
    | st.builds(Light, st.just("headlight"), shadows=NUMBERS, occlusion=NUMBERS)
)
def test_every_light_is_read_as_it_was_written(light):
    assert light_of(yaml.safe_load(yaml.safe_dump(plain_light(light)))) == light


SCALARS = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=9)
ANYTHING = st.recursive(SCALARS, lambda x: st.lists(x, max_size=3) | st.dictionaries(st.text(max_size=9), x))


@given(
    st.dictionaries(st.sampled_from([*LIGHT_KEYS, "colour"]), ANYTHING | st.just("headlight") | NUMBERS)
    | ANYTHING
)
def test_anything_is_a_light_or_refused_in_a_sentence(value):
    try:
        said = f"light: {plain_light(light_of(value))}"
    except ArgumentError as error:
        said = str(error)
    assert said.startswith("light")
    assert said.isprintable()


@pytest.mark.parametrize(
    ("light", "line"),
    [
        (Light("headlight"), "light: headlight"),
        (Light("directional", 30.0, -10.0), "light: {azimuth: 30.0, polar: -10.0}"),
        (Light("headlight", occlusion=0.5), "light: {kind: headlight, occlusion: 0.5}"),
        (
            Light("directional", 3.0, 4.0, 0.7, 0.5, 0.3),
            "light: {kind: directional, azimuth: 3.0, polar: 4.0, shadows: 0.7, occlusion: 0.5, reach: 0.3}",
        ),
    ],
)
def test_lights_without_shadows_are_written_as_before_there_were_any(folder, light, line):
    path = write_scene(folder / "scene.yaml", replace(scene_in(folder), light=light))
    written = path.read_text().partition("background:")[0].splitlines()[1:]
    assert " ".join(each.strip() for each in written) == line
    assert read_scene(path).light == light


@pytest.mark.parametrize(
    "value", [[30, -10], {"azimuth": 30, "polar": -10}, {"polar": -10, "kind": "directional", "azimuth": 30}]
)
def test_a_direction_keeps_the_shadows_that_it_does_not_name(value):
    before = Light("headlight", shadows=0.7, occlusion=0.5, reach=0.3)
    assert light_of(value) == Light("directional", 30.0, -10.0)
    assert light_of(value, before) == replace(before, kind="directional", azimuth=30.0, polar=-10.0)
    assert light_of("headlight", light_of(value, before)) == before
    assert light_of({"kind": "headlight", "shadows": 0}, before) == replace(before, shadows=0.0)


def test_a_folder_may_move(folder):
    write_scene(folder / "scenes" / "scene.yaml", scene_in(folder))
    folder.rename(folder.with_name("elsewhere"))
    scene = read_scene(folder.with_name("elsewhere") / "scenes" / "scene.yaml").open()
    assert len(scene) == 300


def test_a_variant_replaces_texels(folder):
    scene = scene_in(folder)
    styled = scene.open().render(CAMERA, edits=[PartEdit(), PartEdit(visible=False)]).color
    half = write_model(folder / "half.safetensors", halved())
    other = Scene({"x": SceneModel(half)}).open().render(CAMERA).color
    assert torch.equal(styled, other)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"texgs-scene": 2}, "texgs-scene: expected 1, got 2"),
        ({"lights": "headlight"}, "the scene: no such key 'lights', did you mean light?"),
        ({"light": "sun"}, "light: expected headlight, or azimuth and polar in degrees, got 'sun'"),
        ({"light": {"azimut": 3}}, "light: no such key 'azimut', did you mean azimuth"),
        ({"light": {"polar": "up"}}, "light.polar: expected a number, got 'up'"),
        ({"light": {"polar": 91}}, "light.polar: expected -90 to 90 degrees, got 91"),
        ({"light": {"azimuth": 10**400, "polar": 0}}, "light.azimuth: expected a number"),
        ({"light": {"kind": ["sun"]}}, r"light.kind: expected headlight or directional, got \['sun'\]"),
        ({"light": {"shadows": 1.5}}, "light.shadows: expected a share from 0 to 1, got 1.5"),
        ({"light": {"kind": "headlight", "occlusion": -0.1}}, "light.occlusion: expected a share from 0 to"),
        ({"light": {"shadows": True}}, "light.shadows: expected a number, got True"),
        ({"light": {"reach": 0}}, "light.reach: expected above 0 to 2 world units, got 0"),
        ({"background": [0, 0]}, "background: expected three numbers from 0 to 1"),
        ({"background": [[[0]]] * 9}, "background: expected three numbers"),
        ({"cuts": []}, "cuts: expected keys with values, got a list"),
        ({"cuts": {"plane": []}}, "cuts.plane: no such key, did you mean planes"),
        ({"cuts": {"planes": [{"offset": 1}]}}, "cuts.planes.0.normal: expected a value, got none"),
        ({"cuts": {"planes": [{"normal": [0, 0, 0]}]}}, "cuts: normal: expected three numbers that are not"),
        ({"cuts": {"box": {"low": [1e9, 0, 0], "high": [1, 1, 1]}}}, "cuts.box.low: expected at most 1e"),
        ({"cuts": {"faces": "dark"}}, "cuts.faces: expected one of shaded, unlit, slice, got dark"),
        ({"cuts": {"window": [1]}}, "cuts.window: expected 2 values, got 1"),
        ({"cuts": {"window": [1, "x"]}}, "cuts.window.1: expected a number, got 'x'"),
        ({"frame": 3}, "frame: expected keys with values, got 3"),
        ({"frame": {"radius": 1}}, "frame.target: expected a value, got none"),
        ({"frame": {"target": [0, 0, "x"], "radius": 1}}, "frame.target.2: expected a number, got 'x'"),
        ({"frame": {"target": [0, 0], "radius": 1}}, "frame: target: expected three numbers, got"),
        ({"frame": {"target": [0, 0, 0], "radius": 0}}, "frame.radius: expected more than 0, got 0"),
        ({"frame": {"target": [0, 0, 0], "radios": 1}}, "frame.radios: no such key, did you mean radius"),
        ({"models": []}, r"models: expected a table of keys and values, got \[\]"),
        ({"models": {}}, "models: expected at least one, got none"),
        ({"models": {"a\x1b[2J": {"file": "x"}}}, "models: expected a name of 1 to 100"),
        ({"models": {"A": {"opacity": 1}}}, "models.A.file: expected the path of a model, got None"),
        ({"models": {"A": {"file": "x", "opasity": 1}}}, "models.A: no such key 'opasity', did you mean op"),
        ({"models": {"A": {"file": "x", "opacity": -1}}}, "models.A.opacity: expected a factor from 0"),
        ({"models": {"A": {"file": "x", "opacity": 10**400}}}, "models.A.opacity: expected a factor from 0"),
        ({"models": {"A": {"file": "x", "palette": [1, 1, 3]}}}, "models.A.palette: expected three numbers"),
        ({"models": {"A": {"file": "x", "texture": 3}}}, "models.A.texture: expected the path of a texture"),
    ],
)
def test_a_mistake_is_named_with_its_place(folder, change, message):
    path = write_scene(folder / "scene.yaml", scene_in(folder))
    path.write_text(json.dumps({**yaml.safe_load(path.read_text()), **change}))  # YAML without aliases
    with pytest.raises(ArgumentError, match=message) as error:
        read_scene(path)
    assert str(error.value).isprintable()


def test_files_that_are_no_scene(folder):
    refused(lambda: read_scene(folder / "none.yaml"), "no such scene, folder or model; check its name, or")
    for text, message in (("a: [1", "YAML, got a mistake in line 1"), ("hello", "a table of keys .*'hello'")):
        (folder / "bad.yaml").write_text(text)
        refused(lambda: read_scene(folder / "bad.yaml"), rf"bad\.yaml: .*expected {message}")
    (folder / "page.html").write_text("<!doctype html>")
    refused(lambda: read_scene(folder / "page.html"), "page.html: ")
    (folder / "empty").mkdir()
    refused(lambda: read_scene(folder / "empty"), "one scene.yaml .* got none")


def test_a_model_is_a_scene_of_its_own(folder):
    model = folder / "a" / "model.safetensors"
    assert read_scene(model) == Scene({"model": SceneModel(model)})


def test_models_and_variants_that_do_not_belong(folder):
    missing = Scene({"A": SceneModel(folder / "none.safetensors")})
    refused(missing.open, r"models\.A: .*none\.safetensors: no such file")
    entry = SceneModel(folder / "b" / "model.safetensors", texture=folder / "a" / "style.safetensors")
    refused(Scene({"B": entry}).open, r"models\.B: .*expected a texture of this model, got one of 150")
    entry = replace(entry, texture=folder / "a" / "model.safetensors")
    refused(Scene({"B": entry}).open, "expected a texgs-texture file, got safetensors of another pr")
    refused(lambda: write_texture(folder / "x", sample("shading")), "stage texture, got shading")


def test_a_variant_that_is_damaged(folder):
    style = folder / "a" / "style.safetensors"
    entry = SceneModel(folder / "a" / "model.safetensors", texture=style)
    whole = style.read_bytes()
    style.write_bytes(whole[:100])
    refused(Scene({"A": entry}).open, "cut short or damaged")
    style.write_bytes(whole)
    tensors, facts = load_file(style), {"texgs-texture": '{"version": 1}'}
    for texels, message in (
        (tensors["texels"][1:], "expected texels and sizes that fit each other"),
        (tensors["texels"] * torch.nan, "texels"),
    ):
        save_file({**tensors, "texels": texels}, style, facts)
        refused(Scene({"A": entry}).open, message)


def test_a_folder_stands_for_the_scene_in_it(folder):
    below = write_scene(folder / "below" / "scene.yaml", scene_in(folder))
    assert read_scene(folder / "below") == read_scene(folder) == read_scene(below)
    write_scene(folder / "scene.yaml", scene_in(folder))
    refused(lambda: read_scene(folder), r"expected one scene.yaml .*, got 2 \(below/scene.yaml, scene.yaml\)")
