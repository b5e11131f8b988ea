"""Every test of the rasterizer and the losses runs on each device here, and on the emulated CUDA kernels."""

import pytest

from tests.devices import device  # noqa: F401, a fixture
from tests.raster.scenes import PRIMITIVES


@pytest.fixture(params=PRIMITIVES)
def drawn(request):
    """A function that turns a scene of surfels into one of each primitive."""
    return PRIMITIVES[request.param]
