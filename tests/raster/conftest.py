"""Every test of the rasterizer and the losses runs on each device of this machine."""

import os

# Idle OpenMP threads are not to spin: on a busy machine that makes small torch operations ten times slower.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

import pytest
import torch

from texgs.raster import native


@pytest.fixture(scope="module", params=["cpu", "cuda"])
def device(request):
    """A device to put tensors on. TEXGS_REQUIRE_CUDA=1 turns tests that would be skipped into failures."""
    if request.param == "cuda" and (reason := missing_for_cuda()):
        if os.environ.get("TEXGS_REQUIRE_CUDA") == "1":
            pytest.fail(reason)
        pytest.skip(reason)
    return torch.device(request.param)


def missing_for_cuda() -> str | None:
    """What tests on a GPU lack on this machine; None where they can run."""
    if not torch.cuda.is_available():
        return "torch sees no GPU on this machine"
    path = native.library_path("cuda")
    return None if path.exists() else f"no {path.name} here: install texgs where there is a CUDA compiler"
