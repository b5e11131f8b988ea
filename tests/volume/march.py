"""A picture of a volume, its depth and its normals, by marching rays through it in torch.

This is the definition that `texgs.volume.caster` is tested against.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn.functional import normalize

from tests.volume.sampled_field import BLOCK, SampledField
from texgs.core import check
from texgs.core.camera import Camera
from texgs.core.light import Light
from texgs.volume.appearance import Appearance
from texgs.volume.grid import Grid
from texgs.volume.transfer import TransferFunction
from texgs.volume.vtk_camera import directions

RAYS = 8192  # marched at a time; bounds the memory
OPAQUE = 1e-3  # transmittance below which a ray ends


class March(NamedTuple):
    """What rays see; all float32."""

    color: Tensor  # [H, W, 3] premultiplied
    alpha: Tensor  # [H, W]
    depth: Tensor  # [H, W] expected camera z, world units; 0 where alpha is 0
    normal: Tensor  # [H, W, 3] expected normal, world axes, towards the camera; length at most 1


def march(
    grid: Grid,
    tf: TransferFunction,
    camera: Camera,
    appearance: Appearance,
    light: Light | None,
    mask: Tensor | None = None,
) -> March:
    """March the rays of a camera through a volume, front to back.

    A sample has opacity 1 - (1 - a)^(step / opacity unit) and the colour of `shade`.

    Args:
        grid: the volume.
        tf: in data values.
        camera: any pinhole.
        appearance: shading and sampling.
        light: colours stay black without.
        mask: [H, W] bool, pixels to look at; the others are 0. Default all.

    Raises:
        ShapeError: if `mask` does not fit.
    """
    height, width = camera.height, camera.width
    mask = torch.ones(height, width, dtype=torch.bool) if mask is None else mask.cpu().bool()
    check.shape("mask", mask, "H W", H=height, W=width)
    field = SampledField.of(grid, tf)
    shading = None
    if light is not None:
        to_viewer, to_light = (torch.from_numpy(vector).float() for vector in directions(camera, light))
        shading = to_viewer, to_light, appearance
    pixels = mask.reshape(-1).nonzero()[:, 0]
    sums = torch.zeros(height * width, 8)  # colour, weight, depth, normal
    for chunk in pixels.split(RAYS) if len(pixels) else ():
        sums[chunk] = _accumulate(field, _rays(camera, chunk, field.half), appearance, shading)
    weight = sums[:, 3:4]
    means = torch.where(weight > 0, sums[:, 4:] / weight.clamp_min(1e-12), 0)
    views = (sums[:, :3], weight[:, 0], means[:, 0], means[:, 1:])
    return March(*(view.reshape(height, width, *view.shape[1:]) for view in views))


def shade(
    color: Tensor, normal: Tensor, to_viewer: Tensor, to_light: Tensor, appearance: Appearance
) -> Tensor:
    """Blinn-Phong with white light: c (k_a + k_d max(n.l, 0)) + k_s max(n.h, 0)^beta, clamped to [0, 1].

    n is turned towards the viewer; the last term is there only where n.l > 0. A zero normal is ambient.

    Args:
        color: [n, 3].
        normal: [n, 3] unit vectors, or 0.
        to_viewer: [3] unit vector, the same everywhere: a distant viewer.
        to_light: [3] unit vector.
        appearance: k_a, k_d, k_s and beta.
    """
    normal = torch.where(normal @ to_viewer[:, None] < 0, -normal, normal)
    n_l = (normal @ to_light)[:, None].clamp_min(0)
    n_h = (normal @ normalize(to_light + to_viewer, dim=0))[:, None].clamp_min(0)
    specular = torch.where(n_l > 0, n_h**appearance.shininess, 0)
    lit = color * (appearance.ambient + appearance.diffuse * n_l) + appearance.specular * specular
    return lit.clamp(0, 1)


@dataclass(frozen=True)
class _Rays:
    """Rays p = origin + z * direction, in units in which the box is [-1, 1]^3; z is that of the camera."""

    origin: Tensor  # [3]
    direction: Tensor  # [n, 3]
    length: Tensor  # [n] of the direction, world units
    near: Tensor  # [n] z where a ray enters the box
    far: Tensor  # [n] z where it leaves; below near where it misses

    def at(self, z: Tensor, rays: Tensor) -> Tensor:
        """Points [m, k, 3] at z [m, k] on the rays numbered [m]."""
        return torch.addcmul(self.origin, z[..., None], self.direction[rays, None])


def _rays(camera: Camera, pixels: Tensor, half: Tensor) -> _Rays:
    """Rays through the centres of pixels [n], numbered row by row, and where they meet the box."""
    viewmat, K = camera.viewmat.double().cpu(), camera.K.double().cpu()
    u, v = pixels % camera.width + 0.5, pixels // camera.width + 0.5
    in_camera = torch.linalg.solve(K, torch.stack([u, v, torch.ones_like(u)]).double())  # [3, n]
    world = in_camera.T @ viewmat[:3, :3]  # [n, 3]
    origin = -viewmat[:3, :3].T @ viewmat[:3, 3] / half
    direction = world / half
    direction = torch.where(direction.abs() < 1e-12, 1e-12, direction)  # parallel to a side of the box
    sides = torch.stack([(-1 - origin) / direction, (1 - origin) / direction])  # [2, n, 3]
    near = sides.amin(dim=0).amax(dim=1).clamp_min(0)
    far = sides.amax(dim=0).amin(dim=1)
    return _Rays(*(x.float() for x in (origin, direction, world.norm(dim=1), near, far)))


def _stretches(field: SampledField, rays: _Rays, stretch: Tensor) -> tuple[Tensor, Tensor]:
    """Middles z [n, k] of stretches of length [n] along the rays, and in which something may be seen."""
    count = int(((rays.far - rays.near) / stretch).max().clamp_min(0).ceil())
    middles = rays.near[:, None] + (torch.arange(count) + 0.5) * stretch[:, None]
    inside = middles - 0.5 * stretch[:, None] < rays.far[:, None]
    return middles, inside & field.may_be_seen(rays.at(middles, torch.arange(len(stretch))))


def _accumulate(
    field: SampledField,
    rays: _Rays,
    appearance: Appearance,
    shading: tuple[Tensor, Tensor, Appearance] | None,
) -> Tensor:
    """Sums over the samples of rays [n, 8]: colour, weight, weighted depth and normal.

    Rays go on by several steps at once, at most 2 BLOCK cells: where nothing is near the middle of such a
    stretch, none of its samples is visible.
    """
    step = appearance.step * field.voxel
    steps = max(1, int(2 * BLOCK / appearance.step))
    stretch = steps * step / rays.length  # [n] of z
    middles, candidates = _stretches(field, rays, stretch)
    places = (torch.arange(steps) + 0.5) / steps - 0.5  # [steps] of a stretch
    sums, through = torch.zeros(len(stretch), 8), torch.ones(len(stretch))
    for middle, candidate in zip(middles.T, candidates.T, strict=True):
        on = (candidate & (through > OPAQUE)).nonzero()[:, 0]  # [m]
        if not len(on):
            continue
        z = middle[on, None] + places * stretch[on, None]  # [m, steps]
        points = rays.at(z, on)
        seen, rgba = field.lookup(field.sample(points).reshape(-1))
        alpha = torch.zeros(z.numel())
        alpha[seen] = 1 - (1 - rgba[:, 3]) ** (step / appearance.opacity_unit)
        alpha = torch.where(z < rays.far[on, None], alpha.reshape(z.shape), 0)
        after = through[on, None] * torch.cumprod(1 - alpha, dim=1)
        weights = torch.cat([through[on, None], after[:, :-1]], dim=1) * alpha
        through[on] = after[:, -1]
        sums[on, 3] += weights.sum(dim=1)
        sums[on, 4] += (weights * z).sum(dim=1)
        weights = weights.reshape(-1, 1)[seen]
        ray = on[seen // steps]
        normal = field.normals(points.reshape(-1, 3)[seen])
        if shading:
            sums[:, :3].index_add_(0, ray, weights * shade(rgba[:, :3], normal, *shading))
        away = (normal * field.half * rays.direction[ray]).sum(dim=1, keepdim=True) > 0
        sums[:, 5:].index_add_(0, ray, weights * torch.where(away, -normal, normal))
    return sums
