"""Segments of models: pictures of edited segments against models that were split by hand."""

from dataclasses import replace

import pytest
import torch
import yaml
from torch.testing import assert_close

from tests.fields.rewritten import rewritten
from tests.fields.surfels.samples import sample
from tests.fields.surfels.test_composition import CAMERA, OUTPUTS, SIDE, ball
from tests.raster.agreement import images
from tests.raster.requirements import require_equal
from tests.refusals import refused
from texgs.core.errors import ArgumentError, ShapeError
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.compact import write_compact
from texgs.fields.surfels.composition import Composition
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.model_file import write_model
from texgs.fields.surfels.variants import labels_of, with_variants, write_texture
from texgs.scene.export import join_surfels
from texgs.scene.scene import Scene, SceneModel, SceneSegment
from texgs.scene.scene_file import read_scene, write_scene
from texgs.scene.segment_file import read_segment, write_segment

HALF = torch.arange(150) % 2 == 0
TENTH = torch.arange(150) < 15


def only(model, mask):
    """The surfels of a mask as a model of their own; the list of texels stays whole."""
    p = dict(model.parameters)
    for name in ("means", "quats", "scales", "opacities", "colors", "sizes", "offsets"):
        p[name] = p[name][mask]
    for name in ("ambient", "diffuse", "specular", "shininess"):
        p[name] = p[name] if len(p[name]) == 1 else p[name][mask]
    return Surfels(p, model.shading)


def with_texels(model, texels):
    return replace(model, parameters={**model.parameters, "texels": texels})


@pytest.mark.parametrize("shared", [True, False])
@pytest.mark.parametrize("edit", [PartEdit(), PartEdit(palette=(0.3, 0.2, 0.9), opacity=0.5, shininess=2.0)])
def test_the_same_edit_everywhere_is_the_edit_of_the_model_bit_for_bit(shared, edit):
    models = [ball(1, shared=shared), ball(2, middle=0.2)]
    plain = Composition(models).render(CAMERA, SIDE, [edit, PartEdit()], outputs=OUTPUTS)
    scene = Composition(models, [[HALF, TENTH], []])
    edited = scene.render(CAMERA, SIDE, [edit, edit, edit, PartEdit()], outputs=OUTPUTS)
    require_equal(images(edited), images(plain))
    if edit == PartEdit():
        assert torch.equal(scene.render(CAMERA, SIDE).color, plain.color)


def test_segments_are_edited_as_models_of_their_own():
    """The scene that has each segment as a separate model is the oracle."""
    model, other = ball(1, shared=False), ball(2, middle=0.2)
    third = TENTH & ~HALF  # what the first segment left of the second
    edits = [
        PartEdit(palette=(1, 0, 0), opacity=0.7),
        PartEdit(opacity=0.3, diffuse=1.5),
        PartEdit(palette=(0, 0, 1), ambient=0.5, specular=3, shininess=0.25),
        PartEdit(diffuse=0.5),
    ]
    split = [only(model, ~HALF & ~third), only(model, HALF), only(model, third), other]
    expected = Composition(split).render(CAMERA, SIDE, edits)
    rendered = Composition([model, other], [[HALF, TENTH], []]).render(CAMERA, SIDE, edits)
    assert_close(rendered.color, expected.color, atol=1e-5, rtol=0)
    assert_close(rendered.alpha, expected.alpha, atol=1e-5, rtol=0)


def test_hiding_a_segment_is_removing_it():
    model = ball(3)
    hidden = Composition([model], [[HALF]]).render(CAMERA, SIDE, [PartEdit(), PartEdit(visible=False)])
    assert torch.equal(hidden.color, Composition([only(model, ~HALF)]).render(CAMERA, SIDE).color)
    alone = Composition([model], [[HALF]]).render(CAMERA, SIDE, [PartEdit(visible=False), PartEdit()])
    assert torch.equal(alone.color, Composition([only(model, HALF)]).render(CAMERA, SIDE).color)


def test_the_first_segment_keeps_what_two_hold():
    first, second = torch.tensor([[1, 1, 0, 0], [0, 1, 1, 0]]).bool()
    assert labels_of([first, second], 4).tolist() == [1, 1, 2, 0]
    assert labels_of([second, first], 4).tolist() == [2, 1, 1, 0]


def test_texels_of_variants_go_to_their_surfels():
    model = ball(4)
    p = model.parameters
    styles = [
        replace(model, parameters={**p, "texels": p["texels"] + 1}),
        replace(model, parameters={**p, "texels": p["texels"] + 2, "colors": p["colors"] - 3}),
    ]
    joined = with_variants(model, labels_of([HALF, TENTH], 150), styles).parameters
    texels, second = joined["texels"], TENTH & ~HALF
    assert torch.equal(joined["colors"], torch.where(second[:, None], p["colors"] - 3, p["colors"]))
    for surfel in range(150):
        own = slice(int(p["offsets"][surfel]), int(p["offsets"][surfel] + p["sizes"][surfel].prod()))
        added = 1 if HALF[surfel] else 2 if TENTH[surfel] else 0
        assert torch.equal(texels[own], p["texels"][own] + added)
    assert with_variants(model, labels_of([HALF], 150), [model]) is model, "nothing is copied"


def test_what_other_programs_read_has_the_edits_of_segments():
    model = ball(5)
    scene = Composition([model], [[HALF]])
    split = Composition([only(model, ~HALF), only(model, HALF)])
    edits = [PartEdit(palette=(0, 1, 0)), PartEdit(opacity=0.5)]
    result, expected = join_surfels(scene.parts, edits), join_surfels(split.parts, edits)
    for mask, part in ((~HALF, slice(75)), (HALF, slice(75, 150))):
        for name, values in result.parameters.items():  # torch rounds the last few in another way, those
            assert_close(values[mask], expected.parameters[name][part])  # that fill no vector of the CPU


@pytest.mark.parametrize(
    ("mask", "edits", "error", "named"),
    [
        (HALF[:9], None, ShapeError, r"segment: .*\[9\]"),
        (HALF.float(), None, ArgumentError, "segment: .* bool"),
        (HALF, [PartEdit()], ArgumentError, "1 models and 1 segments, got 1"),
    ],
)
def test_segments_that_do_not_fit(mask, edits, error, named):
    refused(lambda: Composition([ball(1)], [[mask]]).render(CAMERA, SIDE, edits), named, error)


@pytest.fixture
def folder(tmp_path):
    """A model, two segments of it and a style of it."""
    model = ball(1)
    write_model(tmp_path / "model.safetensors", model)
    write_segment(tmp_path / "half.safetensors", model, HALF, {"clicks": [[1, 2]]})
    write_segment(tmp_path / "tenth.safetensors", model, TENTH)
    write_texture(tmp_path / "style.safetensors", with_texels(model, 1 - model.parameters["texels"]))
    return tmp_path


def scene_in(folder, **segments):
    return Scene({"TF01": SceneModel(folder / "model.safetensors", segments=segments)})


def test_a_scene_with_segments_is_saved_and_opened(folder):
    styled = SceneSegment(folder / "half.safetensors", PartEdit(opacity=0.5), folder / "style.safetensors")
    plain = SceneSegment(folder / "tenth.safetensors")
    path = write_scene(folder / "scenes" / "scene.yaml", scene_in(folder, shell=styled, core=plain))
    values = yaml.safe_load(path.read_text())["models"]["TF01"]["segments"]
    assert values["core"] == {"file": "../tenth.safetensors"}, "only what is edited"
    scene = read_scene(path)
    assert list(scene.models["TF01"].segments) == ["shell", "core"]
    assert scene.edits == [PartEdit(), PartEdit(opacity=0.5), PartEdit()]
    model = ball(1)
    style = with_texels(model, 1 - model.parameters["texels"])
    split = [only(model, ~HALF & ~TENTH), only(style, HALF), only(model, TENTH & ~HALF)]
    expected = Composition(split).render(CAMERA, edits=scene.edits)
    assert_close(scene.open().render(CAMERA, edits=scene.edits).color, expected.color, atol=1e-5, rtol=0)


def test_a_segment_without_a_variant_has_the_texels_of_the_model(folder):
    scene = scene_in(folder, shell=SceneSegment(folder / "half.safetensors"))
    entry = replace(scene.models["TF01"], texture=folder / "style.safetensors")
    model = ball(1)
    style = with_texels(model, 1 - model.parameters["texels"])
    expected = Composition([only(style, ~HALF), only(model, HALF)]).render(CAMERA).color
    assert_close(Scene({"TF01": entry}).open().render(CAMERA).color, expected, atol=1e-5, rtol=0)


def test_a_segment_outlives_an_exchange_of_formats(folder):
    compact = write_compact(folder / "model.texgs", ball(1))
    entry = SceneModel(compact, segments={"shell": SceneSegment(folder / "half.safetensors")})
    assert torch.equal(Scene({"TF01": entry}).open().parts[0].labels, HALF.long())


@pytest.mark.parametrize("model", [ball(2), ball(1, n=151), sample("texture", 7), sample("shading", 0)])
def test_a_segment_of_another_model(folder, model):
    refused(lambda: read_segment(folder / "half.safetensors", model), "of another with 150")
    write_model(folder / "model.safetensors", model)
    scene = scene_in(folder, shell=SceneSegment(folder / "half.safetensors"))
    refused(scene.open, r"models\.TF01: segments\.shell: .*half\.safetensors")


def test_files_that_are_no_segment(folder):
    for mask in (torch.zeros(150, dtype=torch.bool), HALF.float()):
        refused(lambda mask=mask: write_segment(folder / "x", ball(1), mask), "holds a surfel")
    assert not (folder / "x").exists()
    for name in ("model.safetensors", "style.safetensors"):
        refused(lambda name=name: read_segment(folder / name, ball(1)), f"{name}: .*texgs-segment")
    path = folder / "half.safetensors"
    for tensors in ({"mask": HALF.float()}, {"mask": HALF, "anchors": torch.full((150, 3), torch.nan)}):
        rewritten(path, "texgs-segment", tensors)
        refused(lambda: read_segment(path, ball(1)), "a mask and anchors|of this model")


@pytest.mark.parametrize(
    ("segments", "named"),
    [
        ([1], "segments"),
        ({"a.b": {"file": "x"}}, "segments: .*a.b"),
        ({"a": {}}, "segments.a.file"),
        ({"a": {"file": "x", "opasity": 1}}, "segments.a: .*'opasity'"),
        ({"a": {"file": "x", "opacity": -1}}, "segments.a.opacity"),
    ],
)
def test_a_mistake_in_a_segment_is_named_with_its_place(folder, segments, named):
    path = write_scene(folder / "scene.yaml", scene_in(folder))
    values = yaml.safe_load(path.read_text())
    values["models"]["TF01"]["segments"] = segments
    path.write_text(yaml.safe_dump(values))
    refused(lambda: read_scene(path), rf"models\.TF01\.{named}")
