import json
import math
import tracemalloc

import pytest
import torch
from safetensors import safe_open
from safetensors.torch import load_file

from texgs.core.errors import ArgumentError
from texgs.core.tensor_file import DTYPES, read_tensor_file, write_tensor_file, write_tensors

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
def test_metadata_that_is_no_json(tmp_path, metadata):
    with pytest.raises(ArgumentError, match="metadata cannot be written as JSON"):
        write_tensor_file(tmp_path / "file", "texgs-test", {"metadata": metadata}, TENSORS)
    assert not (tmp_path / "file").exists()


def test_the_library_reads_what_was_written(tmp_path):
    tensors = {str(dtype): torch.arange(6).reshape(2, 3).to(dtype) for dtype in DTYPES}
    tensors |= {"one": torch.tensor(3), "none": torch.empty(0, 4), "turned": torch.rand(3, 5).T}
    path = write_tensors(tmp_path / "a.safetensors", tensors, {"about": "a test"})
    read = load_file(path)
    assert set(read) == set(tensors)
    for name, x in tensors.items():
        assert torch.equal(read[name], x)
        assert read[name].dtype == x.dtype
    with safe_open(path, "pt") as file:
        assert file.metadata() == {"about": "a test"}
    again = write_tensors(tmp_path / "b.safetensors", dict(reversed(tensors.items())), {"about": "a test"})
    assert path.read_bytes() == again.read_bytes()


def test_nothing_is_copied(tmp_path):
    large = {"x": torch.rand(2_000_000)}
    tracemalloc.start()
    write_tensors(tmp_path / "a.safetensors", large)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 1_000_000, "of 8,000,000 bytes"
