"""Editable, relightable, stylisable 3D scenes of textured 2D Gaussians from scientific volumes."""

__version__ = "0.1.0"
