"""Devices that tests run on: those of this machine, and the emulated CUDA kernels."""

import os

from texgs.core.memory import waiting

os.environ.update(waiting())  # before torch is imported

import zlib

import pytest
import torch

from tests.cuda_emulation import emulated
from texgs.raster import native


def missing_for_cuda() -> str | None:
    """Return what tests on a GPU lack on this machine; None where they can run."""
    if not torch.cuda.is_available():
        return "torch sees no GPU on this machine"
    path = native.library_path("cuda")
    return None if path.exists() else f"no {path.name} here: install texgs where there is a CUDA compiler"


MISSING_FOR_CUDA = missing_for_cuda()
HAS_CUDA = MISSING_FOR_CUDA is None or os.environ.get("TEXGS_REQUIRE_CUDA") == "1"
EMULATED = pytest.param("emulated cuda", marks=pytest.mark.emulated)


@pytest.fixture(params=["cpu", *(["cuda"] if HAS_CUDA else []), EMULATED])
def device(request):
    """A device to put tensors on. TEXGS_REQUIRE_CUDA=1 makes tests fail where there is no GPU.

    "emulated cuda" is the CPU, with the CUDA kernels compiled for it (docs/api.md).
    """
    if request.param == "cuda" and MISSING_FOR_CUDA:
        pytest.fail(MISSING_FOR_CUDA)
    if request.param != "emulated cuda":
        yield torch.device(request.param)
        return
    if request.node.get_closest_marker("large"):
        pytest.skip("too large for the emulation of CUDA")
    if reason := emulated.missing():
        pytest.skip(reason)
    with emulated.emulated_cuda(seed=zlib.crc32(request.node.nodeid.encode())):
        yield torch.device("cpu")
