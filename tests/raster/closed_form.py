"""A camera and surfels for which images can be written down."""

import torch

FOCAL, WIDTH, HEIGHT = 40.0, 31, 25
CENTRE = (15.5, 12.5)  # principal point: the centre of pixel (15, 12)


def view(**surfels):
    """Arguments of rasterize for an unmoved camera; one row per surfel, rotations default to facing it."""
    surfels = {name: torch.tensor(rows, dtype=torch.float64) for name, rows in surfels.items()}
    facing = torch.tensor([[1.0, 0, 0, 0]], dtype=torch.float64)
    surfels.setdefault("quats", facing.expand(len(surfels["means"]), 4))
    K = torch.tensor([[FOCAL, 0, CENTRE[0]], [0, FOCAL, CENTRE[1]], [0, 0, 1]], dtype=torch.float64)
    return {"viewmat": torch.eye(4, dtype=torch.float64), "K": K, "width": WIDTH, "height": HEIGHT, **surfels}


def offsets():
    """Distances [H, W] of pixel centres from the principal point along x and along y."""
    y, x = torch.meshgrid(
        torch.arange(HEIGHT, dtype=torch.float64) - 12,
        torch.arange(WIDTH, dtype=torch.float64) - 15,
        indexing="ij",
    )
    return x, y
