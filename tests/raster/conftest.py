"""Every test of the rasterizer and the losses runs on each device of this machine."""

import os

# Idle OpenMP threads are not to spin: on a busy machine that makes small torch operations ten times slower.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

import pytest
import torch


@pytest.fixture(scope="module", params=["cpu", "cuda"])
def device(request):
    """A device to put tensors on."""
    if request.param == "cuda" and not torch.cuda.is_available():
        pytest.skip("no GPU on this machine")
    return torch.device(request.param)
