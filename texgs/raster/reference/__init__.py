"""The rasterizer and the losses as definitions in plain torch, readable and slow."""

from texgs.raster.reference.render import rasterize, splat

__all__ = ["rasterize", "splat"]
