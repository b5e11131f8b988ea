import tracemalloc

import pytest
import torch
from safetensors import safe_open
from safetensors.torch import load_file

from texgs.core.errors import ArgumentError
from texgs.core.tensors import DTYPES, write_tensors


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


def test_a_folder_that_cannot_be_is_one_sentence(tmp_path):
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(ArgumentError, match="cannot write there"):
        write_tensors(tmp_path / "file" / "a", {"x": torch.zeros(1)})
