import json
import math
import tracemalloc

import pytest
import torch
from safetensors import safe_open
from safetensors.torch import load_file

from tests.refusals import refused
from texgs.core.tensor_file import DTYPES, read_tensor_file, write_tensor_file, write_tensors

TENSORS = {"x": torch.arange(6.0).reshape(2, 3)}


@pytest.mark.parametrize(
    ("header", "named"),
    [
        ({"texgs-other": "{}"}, "another program"),
        ({"texgs-test": json.dumps({"version": 2})}, "got 2"),
        *(({"texgs-test": text}, "JSON with a version") for text in ("{}", "[" * 100_000)),
    ],
)
def test_a_header_of_something_else(tmp_path, header, named):
    path = write_tensors(tmp_path / "file", TENSORS, header)
    refused(lambda: read_tensor_file(path, "texgs-test", 1), named)


@pytest.mark.parametrize("metadata", [{"loss": math.nan}, {"camera": object()}])
def test_metadata_that_is_no_json(tmp_path, metadata):
    path, description = tmp_path / "file", {"metadata": metadata}
    refused(lambda: write_tensor_file(path, "texgs-test", description, TENSORS), "metadata ")
    assert not path.exists()


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
