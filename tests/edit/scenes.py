"""A textured ball in memory, seen from around."""

import torch
from kornia.geometry.conversions import rotation_matrix_to_quaternion

from tests.fit.scenes import HEADLIGHT, RADIUS, cameras
from texgs.edit.style_picture import StylePicture
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import ShadingModel, raw_material
from texgs.volume.images import Images


def sphere_points(count):
    """Evenly spread unit vectors [count, 3]: a Fibonacci spiral."""
    index = torch.arange(count) + 0.5
    height = 1 - 2 * index / count
    angle = index * 2.399963
    flat = (1 - height**2).sqrt()
    return torch.stack([flat * angle.cos(), height, flat * angle.sin()], dim=1)


def ball(count=400, side=5, opacity=4.0):
    """Surfels on a sphere that face outwards, with textures of one colour in an order of their own."""
    normals = sphere_points(count)
    helper = torch.eye(3)[normals.abs().argmin(dim=1)]
    first = torch.nn.functional.normalize(torch.linalg.cross(helper, normals), dim=1)
    axes = torch.stack([first, torch.linalg.cross(normals, first), normals], dim=2)
    sigma = 1.6 * RADIUS / count**0.5
    order = torch.randperm(count, generator=torch.Generator().manual_seed(1))
    colors = torch.tensor([0.3, -0.2, 0.4]).expand(count, 3) + 0.05 * normals
    return Surfels(
        {
            "means": RADIUS * normals,
            "quats": rotation_matrix_to_quaternion(axes),
            "scales": torch.full((count, 2), sigma).log(),
            "opacities": torch.full((count,), opacity),
            "colors": colors,
            **raw_material(0.4, 0.5, 0.2, 20.0, "bounded"),
            "palette": torch.tensor([0.6, 0.5, 0.1]),
            "texels": torch.zeros(count * side**2, 3),
            "sizes": torch.full((count, 2), side, dtype=torch.int32),
            "offsets": order * side**2,
        },
        ShadingModel(),
    )


def images_of(field, count=6, size=48):
    """Images of a field over white, as training views would be."""
    around, planes = cameras(count, size), []
    with torch.no_grad():
        for camera in around:
            shown = field.render(camera)
            planes.append(torch.cat([shown.color, shown.alpha[..., None]], dim=2).permute(2, 0, 1))
    stack = torch.stack(planes).clamp(0, 1).mul(255).round().to(torch.uint8)
    return Images(stack, around, [HEADLIGHT] * count)


def plain_style(color):
    """A style of one colour."""
    return StylePicture.of(torch.tensor(color)[:, None, None].expand(3, 40, 40).contiguous())


def views(count=6, size=64):
    """Cameras around the ball and their lights."""
    return cameras(count, size), [HEADLIGHT] * count
