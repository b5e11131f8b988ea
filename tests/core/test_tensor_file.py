import json
import math

import pytest
import torch

from tests.fields.surfels.samples import sample
from tests.fields.voxels.test_voxels import ball
from texgs.core.errors import ArgumentError
from texgs.core.tensor_file import read_tensor_file, write_tensor_file
from texgs.core.tensors import write_tensors
from texgs.fields.surfels.texture_file import write_texture
from texgs.fields.voxels.file import write_voxels
from texgs.fields.voxels.model import Voxels
from texgs.scene.segment_file import write_segment

TENSORS = {"x": torch.arange(6.0).reshape(2, 3)}


def test_what_is_read_is_what_was_written(tmp_path):
    description = {"version": 1, "metadata": {"made of": ["a", 0.5]}}
    path = write_tensor_file(tmp_path / "file", "texgs-test", description, TENSORS)
    read, tensors = read_tensor_file(path, "texgs-test", 1)
    assert read == description
    assert torch.equal(tensors["x"], TENSORS["x"])


@pytest.mark.parametrize(
    ("header", "message"),
    [
        ({"texgs-other": "{}"}, "expected a texgs-test file, got safetensors of another program"),
        ({"texgs-test": json.dumps({"version": 2})}, "expected version 1 of the format at most, got 2"),
        ({"texgs-test": "{}"}, "expected JSON with a version in the header"),
        ({"texgs-test": "[" * 100_000}, "expected JSON with a version in the header"),
    ],
)
def test_a_header_of_something_else(tmp_path, header, message):
    path = write_tensors(tmp_path / "file", TENSORS, header)
    with pytest.raises(ArgumentError, match=message):
        read_tensor_file(path, "texgs-test", 1)


@pytest.mark.parametrize("metadata", [{"loss": math.nan}, {"camera": object()}])
@pytest.mark.parametrize("write", ["texture", "segment", "voxels"])
def test_metadata_that_is_no_json(tmp_path, write, metadata):
    path = tmp_path / "file"
    writers = {
        "texture": lambda: write_texture(path, sample(), metadata),
        "segment": lambda: write_segment(path, sample(), torch.arange(7) < 3, metadata),
        "voxels": lambda: write_voxels(path, Voxels(ball().grid, metadata=metadata)),
    }
    with pytest.raises(ArgumentError, match="metadata cannot be written as JSON"):
        writers[write]()
    assert not path.exists()
