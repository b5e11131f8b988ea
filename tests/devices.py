"""Devices that tests run on: each one here, and the emulated CUDA kernels."""

import os

from texgs.core.waiting import waiting

os.environ.update(waiting())  # before torch is imported

import zlib

import pytest
import torch

from tests.cuda_emulation import emulated
from texgs.raster import native


@pytest.fixture(params=["cpu", "cuda", "emulated cuda"])
def device(request):
    """A device to put tensors on. TEXGS_REQUIRE_CUDA=1 turns tests that would be skipped into failures.

    "emulated cuda" is the CPU, with the CUDA kernels compiled for it (docs/api.md).
    """
    if request.param == "emulated cuda":
        if request.node.get_closest_marker("large"):
            pytest.skip("too large for the emulation of CUDA")
        if reason := emulated.missing():
            pytest.skip(reason)
        with emulated.emulated_cuda(seed=zlib.crc32(request.node.nodeid.encode())):
            yield torch.device("cpu")
        return
    if request.param == "cuda" and (reason := missing_for_cuda()):
        if os.environ.get("TEXGS_REQUIRE_CUDA") == "1":
            pytest.fail(reason)
        pytest.skip(reason)
    yield torch.device(request.param)


def missing_for_cuda() -> str | None:
    """What tests on a GPU lack on this machine; None where they can run."""
    if not torch.cuda.is_available():
        return "torch sees no GPU on this machine"
    path = native.library_path("cuda")
    return None if path.exists() else f"no {path.name} here: install texgs where there is a CUDA compiler"
