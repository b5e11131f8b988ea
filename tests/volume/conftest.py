"""Rays through volumes run on each device here, and on the emulated CUDA kernels."""

import pytest
import torch

from tests.devices import device  # noqa: F401, a fixture


@pytest.fixture(scope="module")
def one_thread():
    """Threads of torch wait for each other, which on a busy machine takes longer than the work."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)
