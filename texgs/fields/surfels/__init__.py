"""Textured 2D Gaussians (surfels)."""
