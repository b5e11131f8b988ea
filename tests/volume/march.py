"""Rays through a volume in torch: the definition that `texgs.volume.caster` is tested against."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import normalize

from texgs.core.camera import Camera
from texgs.core.light import Light
from texgs.raster.api import CutRange
from texgs.volume.grid import Grid
from texgs.volume.render import Appearance, directions
from texgs.volume.transfer import TransferFunction

# Factors [m, 2] of lamp and ambient light at points [m, 3] of the world, whose normals [m, 3] are unit
# vectors on the side of the viewer, or 0.
Exposure = Callable[[Tensor, Tensor], Tensor]


LEAST_WEIGHT = 1e-6  # of a sample that is shaded


class March(NamedTuple):
    """What rays see; all float32."""

    color: Tensor  # [H, W, 3] premultiplied
    alpha: Tensor  # [H, W]
    depth: Tensor  # [H, W] expected camera z, world units; 0 where alpha is 0
    normal: Tensor  # [H, W, 3] expected normal, world axes, towards the camera; length at most 1


def march(
    grid: Grid,
    tf: TransferFunction | list[TransferFunction],  # one, or one for each of some channels
    camera: Camera,
    look: Appearance,
    light: Light,
    exposure: Exposure | None = None,  # of samples to light; None: nothing hides any
    cut: CutRange | None = None,
) -> March:
    """March the rays of a camera through a volume, front to back.

    A sample has opacity 1 - (1 - a)^(step / opacity unit) and the colour of `shade`. Of several channels it
    has the product of what is let through, and colours and normals by their shares of the logarithm of that.
    What is outside of a function's mask has no opacity.
    A cut leaves what of the steps of samples lies in its range. Over an opacity unit behind a face they are
    shaded by its normal, and where that is most of their step, light comes along it.
    """
    tfs = [tf] if isinstance(tf, TransferFunction) else tf
    channels = [as_tensor(grid.channel(each.channel).values) for each in tfs]
    half, cells = torch.tensor(grid.aabb[1]), torch.tensor(grid.dims) - 1
    step = look.step * float((2 * half / cells).min())
    rays = camera.rays().reshape(-1, 3)  # [n, 3], camera z is 1
    # In units in which the box is [-1, 1]^3; no ray is parallel to a side of it.
    origin, direction = camera.position / half, torch.where(rays.abs() < 1e-12, 1e-12, rays) / half
    sides = torch.stack([(-1 - origin) / direction, (1 - origin) / direction])  # [2, n, 3]
    near, far = sides.amin(dim=0).amax(dim=1).clamp_min(0), sides.amax(dim=0).amin(dim=1)
    stretch = step / rays.norm(dim=1)  # [n] of z
    count = int(((far - near) / stretch).max().clamp_min(0).ceil())
    z = near[:, None] + (torch.arange(count) + 0.5) * stretch[:, None]  # [n, k]
    points = origin + z[..., None] * direction[:, None]  # [n, k, 3]
    seen = [each(sample(values, points)) for each, values in zip(tfs, channels, strict=True)]
    rgba = torch.from_numpy(np.stack(seen)).float()  # [C, n, k, 4]
    for each, of_channel in zip(tfs, rgba, strict=True):
        of_channel[~inside(grid, each, points), 3] = 0
    left, of_face, plane = shares_of(cut, near, stretch, count, look.opacity_unit / step)
    own = 1 - (1 - rgba[..., 3]) ** (left * (step / look.opacity_unit))
    own = torch.where(z < far[:, None], own, 0)
    alpha = 1 - (1 - own).prod(dim=0) if len(tfs) > 1 else own[0]
    extinction = -torch.log1p(-own.double().clamp_max(1 - 1e-9))
    shares = (extinction / extinction.sum(dim=0).clamp_min(1e-30)).float() if len(tfs) > 1 else own / own
    through = torch.cumprod(1 - alpha, dim=1)
    weights = (torch.cat([torch.ones(len(z), 1), through[:, :-1]], dim=1) * alpha)[..., None]  # [n, k, 1]
    ray, k = (weights[..., 0] > LEAST_WEIGHT).nonzero().T
    around = points[ray, k][:, None] + torch.stack([torch.diag(2 / cells), -torch.diag(2 / cells)])[:, None]
    to_viewer, to_light = (torch.from_numpy(vector).float() for vector in directions(camera, light))
    color, facing = torch.zeros(*z.shape, 3), torch.zeros(*z.shape, 3)
    part, plane = of_face[ray, k, None], plane[ray]
    for values, (red_green_blue, share) in zip(
        channels, zip(rgba[..., :3], shares, strict=True), strict=True
    ):
        ahead, behind = sample(values, around)
        normal = normalize(
            (ahead - behind) * (cells / half), dim=-1, eps=1e-30
        )  # central differences, [m, 3]
        out = torch.where(part > 0.5, plane, torch.where(normal @ to_viewer[:, None] < 0, -normal, normal))
        factors = exposure(points[ray, k] * half, out) if exposure else torch.ones(len(ray), 2)
        inner, outer = (
            shade(red_green_blue[ray, k], n, to_viewer, to_light, look, factors) for n in (normal, plane)
        )
        color[ray, k] += share[ray, k, None] * torch.lerp(inner, outer, part)
        normal = torch.where(part > 0.5, plane, normal)
        away = (normal * rays[ray]).sum(dim=1, keepdim=True) > 0
        facing[ray, k] += share[ray, k, None] * torch.where(away, -normal, normal)
    weight = weights.sum(dim=1)  # [n, 1]
    sums = [(weights * x).sum(dim=1) for x in (color, z[..., None], facing)]
    depth, normal = (torch.where(weight > 0, x / weight.clamp_min(1e-12), 0) for x in sums[1:])
    planes = (sums[0], weight[:, 0], depth[:, 0], normal)
    return March(*(plane.reshape(camera.height, camera.width, *plane.shape[1:]) for plane in planes))


def shares_of(
    cut: CutRange | None, near: Tensor, stretch: Tensor, count: int, unit: float
) -> tuple[Tensor, Tensor, Tensor]:
    """Return shares [n, k] of samples' steps that a cut leaves, those of a face, and its normal [n, 3].

    Rays start at camera z `near` [n], steps are `stretch` [n] of it; an opacity unit is so many steps.
    """
    if cut is None:
        return torch.ones(len(near), count), torch.zeros(len(near), count), torch.zeros(len(near), 3)
    k = torch.arange(count)
    begin, end = (cut.depth_range.reshape(2, -1, 1) - near[:, None]) / stretch[:, None]
    face = cut.face.reshape(-1, 1)
    of_face = torch.where(face >= 0, (begin + unit - k).clamp(0, 1), 0)
    left = torch.minimum(k + 1, end) - torch.maximum(k, begin)
    return left.clamp(0, 1), of_face, cut.normals[face[:, 0].clamp_min(0)]


def as_tensor(values: np.ndarray, dtype: type = np.float32) -> Tensor:
    """Return samples of any type as floats."""
    return torch.from_numpy(values.astype(dtype))


def inside(grid: Grid, tf: TransferFunction, points: Tensor) -> Tensor:
    """Return whether points [..., 3] in [-1, 1] are inside of a function's mask, if it has one."""
    if tf.within is None:
        return torch.ones(points.shape[:-1], dtype=torch.bool)
    mask = as_tensor(grid.channel(tf.within).values, np.float64).to(points)
    return sample(mask, points) >= 127.5


def sample(values: Tensor, points: Tensor) -> Tensor:
    """Return values [...] of a volume [Z, Y, X] at points [..., 3] in [-1, 1], trilinear, constant outside.

    Between equal values it is exactly these: a + t (b - a), where grid_sample rounds.
    """
    cells = torch.tensor(values.shape[::-1]) - 1
    place = ((points + 1) * (cells / 2)).clamp(min=torch.zeros(3), max=cells.float())
    lower = torch.minimum(place.floor(), cells - 1.0)
    inside, (x, y, z) = place - lower, lower.long().unbind(-1)
    corners = [values[z + dz, y + dy, x + dx] for dz, dy, dx in np.ndindex(2, 2, 2)]
    for axis in range(3):
        pairs = zip(corners[::2], corners[1::2], strict=True)
        corners = [torch.lerp(low, high, inside[..., axis]) for low, high in pairs]
    return corners[0]


def shade(
    color: Tensor,
    normal: Tensor,
    to_viewer: Tensor,
    to_light: Tensor,
    look: Appearance,
    factors: Tensor | None = None,
) -> Tensor:
    """Return Blinn-Phong with white light: c (k_a A + L k_d max(n.l, 0)) + L k_s max(n.h, 0)^beta, in [0, 1].

    n is turned towards the viewer; the last term is there only where n.l > 0. A zero normal is ambient.
    Colours and normals are [n, 3], the directions to the distant viewer and to the light [3], factors L and A
    [n, 2], or 1.
    """
    lamp, ambient = torch.ones(2, len(color), 1) if factors is None else factors.T[..., None]
    normal = torch.where(normal @ to_viewer[:, None] < 0, -normal, normal)
    n_l = (normal @ to_light)[:, None].clamp_min(0)
    n_h = (normal @ normalize(to_light + to_viewer, dim=0))[:, None].clamp_min(0)
    specular = lamp * torch.where(n_l > 0, n_h**look.shininess, 0)
    return (color * (look.ambient * ambient + look.diffuse * lamp * n_l) + look.specular * specular).clamp(
        0, 1
    )
