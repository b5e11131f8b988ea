"""Textured balls in memory, seen from around, and edits of scenes as methods get them."""

import torch
from torch.nn.functional import normalize

from tests.fitting.scenes import HEADLIGHT, RADIUS, cameras
from texgs.core.camera import orbit
from texgs.core.lens import Lens
from texgs.edit.keys import EditKeys
from texgs.edit.style_picture import StylePicture
from texgs.edit.task import Task
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import ShadingModel, raw_material
from texgs.fitting.texels import add_texture
from texgs.volume.images import Images

SHELL = 0.4  # radius, world units


def sphere_points(count):
    """Evenly spread unit vectors [count, 3]: a Fibonacci spiral."""
    index = torch.arange(count) + 0.5
    height = 1 - 2 * index / count
    angle = index * -2.399963
    flat = (1 - height**2).sqrt()
    return torch.stack([flat * angle.cos(), height, flat * angle.sin()], dim=1)


def on_sphere(normals, radius, size, opacity):
    """Raw geometry of round surfels on a sphere around the origin that face outwards."""
    count = len(normals)
    half = torch.stack([1 + normals[:, 2], -normals[:, 1], normals[:, 0], torch.zeros(count)], dim=1)
    return {
        "means": radius * normals,
        "quats": normalize(half, dim=1),  # turns +z to the normal
        "scales": torch.full((count, 2), size).log(),
        "opacities": torch.full((count,), opacity),
    }


def ball(count=400, side=5, opacity=4.0):
    """Surfels with textures of one colour in an order of their own."""
    normals = sphere_points(count)
    order = torch.randperm(count, generator=torch.Generator().manual_seed(1))
    return Surfels(
        {
            **on_sphere(normals, RADIUS, 1.6 * RADIUS / count**0.5, opacity),
            "colors": torch.tensor([0.3, -0.2, 0.4]) + 0.05 * normals,
            **raw_material(0.4, 0.5, 0.2, 20.0, "bounded"),
            "palette": torch.tensor([0.6, 0.5, 0.1]),
            "texels": torch.zeros(count * side**2, 3),
            "sizes": torch.full((count, 2), side, dtype=torch.int32),
            "offsets": order * side**2,
        },
        ShadingModel(),
    )


def views(count=6, size=64):
    """Cameras around the ball and their lights."""
    return cameras(count, size), [HEADLIGHT] * count


def two_steps():
    """The ball with its upper half hidden, and the step at which all of it is there, farther to the right."""
    p = ball().parameters
    upper = p["means"][:, 1] > 0.05
    key = {**p, "opacities": torch.where(upper, -12.0, p["opacities"])}
    step = {**p, "means": p["means"] + torch.tensor([0.1, 0.0, 0.0])}
    return Surfels(key, ball().shading), Surfels(step, ball().shading), upper


def shell(count=160, texels=5, opacity=3.0, seed=0):
    """Surfels that are opaque together, in one colour and some noise: few enough for brute force."""
    p = {
        **on_sphere(sphere_points(count), SHELL, 1.5 * SHELL * (torch.pi / count) ** 0.5, opacity),
        "colors": torch.tensor([[0.7, 0.6, 0.2]]).repeat(count, 1),
        **raw_material(0.4, 0.6, 0.2, 20, "bounded"),
    }
    sizes = torch.full((count, 2), texels, dtype=torch.int32)
    model = add_texture(Surfels(p, ShadingModel(low_pass=6.0)), torch.tensor([0.5, 0.5, 0.3]), sizes)
    noise = torch.randn(model.parameters["texels"].shape, generator=torch.Generator().manual_seed(seed))
    return Surfels({**model.parameters, "texels": 0.03 * noise}, model.shading, {"dataset": "shell"})


def around(count=12, size=48):
    """Cameras from all sides of the shell, above and below."""
    heights = torch.linspace(-75, 75, count).tolist()
    return [orbit(360 * 0.618 * i, height, 2.5, 26, size, size) for i, height in enumerate(heights)]


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


class AnyViews(Task):
    """A task whose models have no training views."""

    def training_views(self, model):
        return []


def task(scene, output, parts=()):
    """An edit of parts of a scene, with no settings of a method."""
    edit = EditKeys("test", parts=list(parts))
    return AnyViews(None, edit, scene, {}, output, torch.device("cpu"), 1, Lens(), "test")
