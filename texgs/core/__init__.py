"""Ground layer: errors, checks, cameras, rotations, images and safe file output."""
