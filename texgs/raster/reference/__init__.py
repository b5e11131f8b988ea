"""The rasterizer and the losses as definitions in plain torch, readable and slow."""
