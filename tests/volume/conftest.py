"""Rays through volumes run on each device here, and on the emulated CUDA kernels."""

from tests.devices import device  # noqa: F401, a fixture
