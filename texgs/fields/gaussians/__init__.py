"""3D Gaussians with spherical harmonics (Kerbl et al. 2023, 3DGS)."""
