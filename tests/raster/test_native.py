"""A native library that does not fit this package is reported, with what to do about it."""

import _ctypes
from contextlib import nullcontext
from pathlib import Path

import pytest
import torch

from tests.refusals import refused
from texgs.core.errors import DeviceError, NativeError, OutOfMemoryError
from texgs.raster import native


@pytest.mark.parametrize(
    ("content", "device", "named"),
    [
        (None, "cpu", r"libtexgs\.so: not found"),
        (None, "cuda", "install a CUDA compiler"),
        (b"not a library", "cpu", r"libtexgs\.so: cannot be loaded"),
        (
            Path(_ctypes.__file__).read_bytes(),
            "cpu",
            "no function texgs_abi_version",
        ),  # one that is none of ours
    ],
)
def test_a_library_that_is_not_ours(monkeypatch, tmp_path, content, device, named):
    path = tmp_path / "libtexgs.so"
    if content is not None:
        path.write_bytes(content)
    monkeypatch.setattr(native, "library_path", lambda device_type: path)
    refused(lambda: native.library.__wrapped__(device), f"{named}.* install texgs again", NativeError)


def test_a_function_and_a_device_that_the_library_does_not_have():
    refused(lambda: native.call("texgs_paint", device=torch.device("cpu")), "texgs_paint", NativeError)
    refused(lambda: native.library("meta"), "cpu or cuda, got meta", DeviceError)


def test_out_of_memory_on_a_gpu_tells_of_what_torch_keeps(monkeypatch):
    def require(device):
        return lambda: native.require_memory(2**60, torch.device(device), "images", "choose smaller ones")

    refused(require("cpu"), r"needs \d+ bytes more$", OutOfMemoryError)
    library = native.library()
    monkeypatch.setattr(native, "library", lambda device_type: library)
    monkeypatch.setattr(torch.cuda, "device", lambda device: nullcontext())
    refused(require("cuda"), r"torch\.cuda\.empty_cache\(\)", OutOfMemoryError)
