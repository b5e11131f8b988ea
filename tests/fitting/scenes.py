"""A small ball seen from around, the same as images in memory and as files, and short phases that fit it."""

import math

import torch

from texgs.core.camera import orbit
from texgs.core.light import Light
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import ShadingModel, raw_material
from texgs.fitting.loop import Fit
from texgs.fitting.seeds import surfels_at
from texgs.fitting.settings import Densify, Losses, Phase, Rates
from texgs.metrics.quality import psnr
from texgs.volume.images import Images

SIZE = 32
RADIUS = 0.3  # of the ball, world units
HEADLIGHT = Light("headlight")


def cameras(count=6, size=SIZE, distance=1.5):
    """Around the ball, above and below the equator."""
    return [orbit(360 * i / count, 25 * (-1) ** i, distance, 50, size, size) for i in range(count)]


def ball_planes(camera, radius=RADIUS, color=(0.8, 0.4, 0.2)):
    """Colour over white and alpha [4, H, W] of a ball without shading but for its rim, by ray casting."""
    rows, columns = torch.meshgrid(
        torch.arange(camera.height) + 0.5, torch.arange(camera.width) + 0.5, indexing="ij"
    )
    pixels = torch.stack([columns, rows, torch.ones_like(rows)], dim=-1)  # [H, W, 3]
    rays = pixels @ torch.linalg.inv(camera.K).T @ camera.viewmat[:3, :3]
    rays = rays / rays.norm(dim=-1, keepdim=True)
    along = -(rays @ camera.position)
    nearest = (camera.position + along[..., None] * rays).norm(dim=-1)
    alpha = (nearest < radius).float()
    facing = (1 - (nearest / radius) ** 2).clamp_min(0).sqrt()
    shaded = torch.tensor(color) * (0.4 + 0.6 * facing[..., None])
    return torch.cat([(shaded * alpha[..., None] + 1 - alpha[..., None]).permute(2, 0, 1), alpha[None]])


def images_of(planes, views):
    """Images of float planes [4, H, W], one for each camera."""
    stack = torch.stack(planes).mul(255).round().to(torch.uint8)
    return Images(stack, list(views), [HEADLIGHT] * len(views))


def ball_images(count=6, **options):
    """The ball from `count` cameras."""
    views = cameras(count, **options)
    return images_of([ball_planes(camera) for camera in views], views)


def blank_images(count=3, size=SIZE):
    """Views of nothing."""
    planes = torch.ones(4, size, size)
    planes[3] = 0
    return images_of([planes] * count, cameras(count, size))


def quality(field, images):
    """Mean PSNR over images."""
    with torch.no_grad():
        seen = [field.render(camera).color.clamp(0, 1) for camera in images.cameras]
    return sum(psnr(color, images.target(i).color) for i, color in enumerate(seen)) / len(seen)


def ball_seeds(count=80, seed=0, opacity=0.1):
    """Raw surfels with colours and one material at random points in a cube that holds the ball."""
    generator = torch.Generator().manual_seed(seed)
    points = (torch.rand(count, 3, generator=generator) - 0.5) * 2 * RADIUS
    parameters = surfels_at(points, opacity, generator)
    return {**parameters, "colors": torch.full((count, 3), 0.5), **raw_material(0.5, 0.5, 0.1, 20, "bounded")}


def random_surfels(seed, count, spread, size):
    """Surfels of any size and tilt around a point off the middle."""
    generator = torch.Generator().manual_seed(seed)
    p = ball_seeds(count, seed, opacity=0.9)
    middle = torch.randn(3, generator=generator) * 0.3
    p["means"] = torch.randn(count, 3, generator=generator) * spread + middle
    p["quats"] = torch.randn(count, 4, generator=generator)
    p["scales"] = torch.log(size * torch.rand(count, 2, generator=generator).clamp_min(1e-3))
    return p


def phase(iterations=60, densify=None, losses=None, rates=None, **options):
    """A phase that densifies at 20, 30 and 40 and resets opacities at 25 and 50."""
    densify = densify or Densify(start=10, stop=50, every=10, threshold=1e-5, cap=150, resets=[25, 50])
    return Phase(
        iterations=iterations, densify=densify, losses=losses or Losses(), rates=rates or Rates(), **options
    )


def new_fit(images=None, parameters=None, seed=0, held=None, **options):
    """A fit of the ball."""
    start = parameters or ball_seeds()
    return Fit(start, ShadingModel(), images or ball_images(), phase(**options), seed, held)


def run(fit, iterations=None):
    """Iterate, to the end unless told; return the fit."""
    for done in fit.run():
        if done == iterations:
            break
    return fit


def model_of(fit):
    """The surfels of a fit as they are now."""
    return Surfels({name: x.detach() for name, x in fit.fitted.items()}, fit.shading)


def is_finite(parameters):
    """Whether no parameter holds NaN or infinity."""
    return all(bool(torch.isfinite(x).all()) for x in parameters.values())


def logit(value):
    """Of a number."""
    return math.log(value / (1 - value))


def striped():
    """The ball with stripes that its surfels are too few to show."""
    views = cameras()
    planes = [ball_planes(camera) for camera in views]
    for camera, plane in zip(views, planes, strict=True):
        rows = torch.arange(camera.height)[None, :, None]
        plane[:3] -= 0.15 * plane[3] * (rows // 3 % 2)
    return images_of(planes, views)
