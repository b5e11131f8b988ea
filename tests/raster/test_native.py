"""A native library that does not fit this package is reported, with what to do about it."""

import _ctypes
from contextlib import nullcontext
from pathlib import Path

import pytest
import torch

from tests.raster.requirements import refuses
from texgs.core.errors import DeviceError, NativeError, OutOfMemoryError
from texgs.raster import native

open_library = native.library.__wrapped__  # past the cache


@pytest.fixture
def replaced(monkeypatch):
    """Put a file in place of the library for as long as a test runs."""
    return lambda path: monkeypatch.setattr(native, "library_path", lambda device_type: Path(path))


def test_missing_library(replaced, tmp_path):
    replaced(tmp_path / "libtexgs.so")
    refuses(NativeError, r"libtexgs\.so: not found in .*; install texgs again", open_library, "cpu")
    refuses(NativeError, "install a CUDA compiler and install texgs again", open_library, "cuda")


def test_file_that_is_no_library(replaced, tmp_path):
    (tmp_path / "libtexgs.so").write_text("not a library")
    replaced(tmp_path / "libtexgs.so")
    refuses(NativeError, r"libtexgs\.so: cannot be loaded: .*; install texgs again", open_library, "cpu")


def test_library_that_lacks_a_function(replaced):
    native.library("cpu")
    replaced(_ctypes.__file__)  # a shared library that every Python has
    refuses(NativeError, "has no function texgs_abi_version; install texgs again", open_library, "cpu")
    message, cpu = "has no function texgs_paint; install texgs again", torch.device("cpu")
    refuses(NativeError, message, native.call, "texgs_paint", device=cpu)


def test_device_without_a_library():
    refuses(DeviceError, "expected tensors on cpu or cuda, got meta", native.library, "meta")


def test_out_of_memory_on_a_gpu_tells_of_what_torch_keeps(monkeypatch):
    refuses(
        OutOfMemoryError,
        r"needs \d+ bytes more$",
        native.require_memory,
        2**60,
        torch.device("cpu"),
        "x",
        "y",
    )
    library = native.library()
    monkeypatch.setattr(native, "library", lambda device_type: library)
    monkeypatch.setattr(torch.cuda, "device", lambda device: nullcontext())
    with pytest.raises(OutOfMemoryError, match=r"bytes more; torch\.cuda\.empty_cache\(\)"):
        native.require_memory(2**60, torch.device("cuda"), "images", "choose smaller ones")
