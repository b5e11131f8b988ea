"""What can be fitted to views and drawn: surfels, 3D Gaussians and voxel grids."""
