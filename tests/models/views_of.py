"""EditViews of nothing in particular, for guidances."""

import torch

from texgs.core.camera import orbit
from texgs.models.guidance import EditViews


def random_views(count=2, height=24, width=32, seed=0, cameras=None):
    """Images of noise, seen through a disc of alpha, on a sphere of points."""
    generator = torch.Generator().manual_seed(seed)
    cameras = cameras or [orbit(50 * i, 20 * i - 20, 3.0, 30, width, height) for i in range(count)]
    images = torch.rand(count, height, width, 3, generator=generator)
    y, x = torch.meshgrid(torch.linspace(-1, 1, height), torch.linspace(-1, 1, width), indexing="ij")
    inside = (1 - x * x - y * y).clamp_min(0)
    alphas = (inside > 0.05).float().expand(count, -1, -1).contiguous()
    local = torch.stack([x, -y, inside.sqrt()], dim=-1)
    turns = [camera.viewmat[:3, :3] * torch.tensor([[1.0], [-1.0], [-1.0]]) for camera in cameras]
    points = torch.stack([0.5 * local @ turn for turn in turns])
    images = images * alphas[..., None] + 1 - alphas[..., None]
    return EditViews(images, images, alphas, points, points * 2, cameras)
