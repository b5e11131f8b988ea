"""Rasterizer of surfels and 3D Gaussians: one function renders, one splats back, on CPU and CUDA alike.

Functions of this package raise ShapeError, ArgumentError or DeviceError of `texgs.core.errors` for arguments
that are wrong, which they name, and OutOfMemoryError for those that are too large.
"""

import torch

from texgs.raster.api import rasterize, splat
from texgs.raster.types import Options, Render, Statistics, Texture

# Where several threads are the first to call MKL's vector functions, results can be off by 1e-4, and a run is
# not the same twice. A first call by one thread prevents that.
torch.zeros(1).exp()

__all__ = ["Options", "Render", "Statistics", "Texture", "rasterize", "splat"]
