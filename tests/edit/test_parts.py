"""Parts of a scene that edits take, from the masks of its segments."""

import pytest
import torch

from tests.fields.surfels.test_composition import ball
from texgs.core.errors import ArgumentError
from texgs.edit.parts import ScenePart, surfels_of
from texgs.scene.scene import SceneModel, SceneSegment


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
