"""Rasterizer of surfels and 3D Gaussians: one function renders, one splats back, on CPU and CUDA alike.

Functions of this package raise ShapeError, ArgumentError or DeviceError of `texgs.core.errors` for arguments
that are wrong, which they name, and OutOfMemoryError for those that are too large.
"""

from texgs.raster.api import rasterize, splat
from texgs.raster.types import Options, Render, Statistics, Texture

__all__ = ["Options", "Render", "Statistics", "Texture", "rasterize", "splat"]
