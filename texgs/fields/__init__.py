"""What can be fitted to views and drawn: surfels, and 3D Gaussians."""
