"""Sparse grids of voxels."""
