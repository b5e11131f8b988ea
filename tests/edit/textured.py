"""A shell of textured surfels around the origin, small enough for brute force."""

import torch

from texgs.core.camera import orbit
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import ShadingModel, raw_material
from texgs.fit.texels import textured

RADIUS = 0.4


def shell(count=160, texels=5, opacity=3.0, seed=0):
    """Surfels on a sphere, tangent to it, opaque together; of stage texture, in one colour and some noise."""
    k = torch.arange(count) + 0.5
    polar, azimuth = torch.arccos(1 - 2 * k / count), torch.pi * (1 + 5**0.5) * k
    normals = torch.stack(
        [polar.sin() * azimuth.cos(), polar.cos(), polar.sin() * azimuth.sin()], dim=1
    )  # evenly spread
    half = torch.stack([1 + normals[:, 2], -normals[:, 1], normals[:, 0], torch.zeros(count)], dim=1)
    quats = half / half.norm(dim=1, keepdim=True)  # turns +z to the normal
    size = RADIUS * 1.5 * (4 * torch.pi / count) ** 0.5 / 2
    p = {
        "means": RADIUS * normals,
        "quats": quats,
        "scales": torch.full((count, 2), size).log(),
        "opacities": torch.full((count,), opacity),
        "colors": torch.tensor([[0.7, 0.6, 0.2]]).repeat(count, 1),
        **raw_material(0.4, 0.6, 0.2, 20, "bounded"),
    }
    sizes = torch.full((count, 2), texels, dtype=torch.int32)
    model = textured(Surfels(p, ShadingModel(low_pass=6.0)), torch.tensor([0.5, 0.5, 0.3]), sizes)
    noise = torch.randn(model.parameters["texels"].shape, generator=torch.Generator().manual_seed(seed))
    return Surfels({**model.parameters, "texels": 0.03 * noise}, model.shading, {"dataset": "shell"})


def around(count=12, size=48):
    """Cameras from all sides, above and below."""
    turns = [360 * 0.618 * i for i in range(count)]
    heights = [-75 + 150 * i / max(count - 1, 1) for i in range(count)]
    return [orbit(a, h, 2.5, 26, size, size) for a, h in zip(turns, heights, strict=True)]
