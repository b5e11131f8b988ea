"""Rasterizer of surfels and 3D Gaussians: one function renders, one splats back, on CPU and CUDA alike."""

from texgs.raster.api import rasterize, splat
from texgs.raster.types import Options, Render, Statistics, Texture

__all__ = ["Options", "Render", "Statistics", "Texture", "rasterize", "splat"]
