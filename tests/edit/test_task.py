"""Parts of a scene that edits take, from the masks of its segments."""

import pytest
import torch

from tests.edit.scenes import task
from tests.fields.surfels.test_composition import ball
from texgs.core.errors import ArgumentError, ConfigError
from texgs.edit.task import parts_of, parts_with_surfels, surfels_of
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.model_file import write_model
from texgs.scene.scene import Scene, SceneModel, SceneSegment
from texgs.scene.segment_file import write_segment


def scene_of(folder, **masks):
    """A scene with a whole model, and one with segments."""
    model = ball(1)
    file = write_model(folder / "ball.safetensors", model)
    segments = {}
    for name, mask in masks.items():
        write_segment(folder / f"{name}.safetensors", model, mask)
        segments[name] = SceneSegment(folder / f"{name}.safetensors")
    return Scene({"plain": SceneModel(file), "cut": SceneModel(file, segments=segments)})


def test_a_part_has_what_earlier_segments_left(tmp_path):
    first = torch.arange(len(ball(1))) < 10
    scene = scene_of(tmp_path, a=first, b=torch.ones_like(first), c=~first)
    assert torch.equal(surfels_of(scene, "cut/a")[1], first)
    assert torch.equal(surfels_of(scene, "cut/b")[1], ~first)
    for part in ("cut", "cut/c"):
        with pytest.raises(ArgumentError, match=f"edit.parts: expected surfels of {part}, got none"):
            surfels_of(scene, part)
    assert surfels_of(scene, "plain")[1] is None
    assert parts_with_surfels(scene) == ["plain", "cut/a", "cut/b"]


def test_parts_are_named_once_and_by_default_all_models(tmp_path):
    scene = scene_of(tmp_path, a=torch.arange(len(ball(1))) < 10)
    assert parts_of(scene, []) == ["plain", "cut"]
    assert parts_of(scene, ["cut/a", "plain"]) == ["cut/a", "plain"]
    with pytest.raises(ArgumentError, match=r"edit\.parts: expected some of plain, cut, cut/a, got cut/b"):
        parts_of(scene, ["cut/b"])
    with pytest.raises(ArgumentError, match=r"edit\.parts: expected different names, got cut twice"):
        parts_of(scene, ["cut", "cut"])


def test_an_edited_part_is_surfels(tmp_path):
    with pytest.raises(ConfigError, match="method none: expected Surfels of each_part, got NoneType"):
        task(scene_of(tmp_path), tmp_path).each_part(lambda part, model, surfels, views: None)


def test_a_new_look_takes_the_palette_of_an_earlier_edit_back(tmp_path):
    """Colours of a look are relative to the fitted palette; another one would tint them."""
    file = write_model(tmp_path / "ball", ball(1))
    scene = Scene({"ball": SceneModel(file, edit=PartEdit(palette=(0, 1, 0), opacity=0.5))})
    edited = task(scene, tmp_path).each_part(lambda part, model, surfels, views: model)
    entry = edited.models["ball"]
    assert entry.texture is not None
    assert entry.edit == PartEdit(opacity=0.5)
