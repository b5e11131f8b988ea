"""Reference definitions of the rasterizer and the losses in plain torch, readable and slow."""

from texgs.raster.reference.render import rasterize, splat

__all__ = ["rasterize", "splat"]
