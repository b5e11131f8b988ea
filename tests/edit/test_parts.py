"""Parts of a scene that edits take, from the masks of its segments."""

import pytest
import torch

from tests.fields.surfels.test_composition import ball
from texgs.core.errors import ArgumentError
from texgs.edit.parts import ScenePart, edit_parts, parts_with_surfels, surfels_of
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.model_file import write_model
from texgs.fields.surfels.variants import labels_of
from texgs.scene.scene import Scene, SceneModel, SceneSegment
from texgs.scene.segment_file import write_segment


def test_a_part_has_what_earlier_segments_left(tmp_path):
    model = ball(1)
    entry = SceneModel(tmp_path, segments={name: SceneSegment(tmp_path) for name in ("a", "b", "c")})
    first, all_of_them = torch.arange(len(model)) < 10, torch.ones(len(model), dtype=torch.bool)
    masks = [first, all_of_them, ~first]
    assert torch.equal(surfels_of(ScenePart("ball", "a"), entry, masks, model), first)
    assert torch.equal(surfels_of(ScenePart("ball", "b"), entry, masks, model), ~first)
    for part in (ScenePart("ball"), ScenePart("ball", "c")):
        with pytest.raises(ArgumentError, match=f"edit.parts: expected surfels of {part.name}, got none"):
            surfels_of(part, entry, masks, model)
    assert surfels_of(ScenePart("ball"), SceneModel(tmp_path), [], model) is None


def test_a_new_look_takes_the_palette_of_an_earlier_edit_back(tmp_path):
    """Colours of a look are relative to the fitted palette; another one would tint them."""
    model = ball(1)
    tinted = SceneModel(write_model(tmp_path / "ball", model), edit=PartEdit(palette=(0, 1, 0), opacity=0.5))
    scene = edit_parts(
        Scene({"ball": tinted}), [], tmp_path, torch.device("cpu"), lambda part, given, surfels: given
    )
    entry = scene.models["ball"]
    assert entry.texture is not None
    assert entry.edit == PartEdit(opacity=0.5)


def test_only_parts_that_have_surfels_are_named(tmp_path):
    model = ball(1)
    write_model(tmp_path / "ball.safetensors", model)
    masks = {"all": torch.ones(len(model), dtype=torch.bool), "left": torch.arange(len(model)) < 10}
    segments = {}
    for name, mask in masks.items():
        write_segment(tmp_path / f"{name}.safetensors", model, mask)
        segments[name] = SceneSegment(tmp_path / f"{name}.safetensors")
    assert labels_of(list(masks.values()), len(model)).unique().tolist() == [1]
    whole = SceneModel(tmp_path / "ball.safetensors")
    scene = Scene({"plain": whole, "cut": SceneModel(whole.file, segments=segments)})
    assert parts_with_surfels(scene) == ["plain", "cut/all"]
