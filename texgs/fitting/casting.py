"""Cast a volume under a function, for fits: views, and the points where their rays end."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.geometry import z_order_of
from texgs.core.lens import Lens
from texgs.core.light import HEADLIGHT, Light, random_lights
from texgs.core.progress import progress
from texgs.volume.cameras import icosphere
from texgs.volume.caster import Caster
from texgs.volume.images import Images, smaller
from texgs.volume.render import Appearance
from texgs.volume.transfer import TransferFunction

FREQUENCY = 4  # frequency of the icosphere of 162 cameras
HEADLIGHT_INTERVAL = 3  # one in three views has a headlight, the others a random light
GLANCE_SIZE = 64  # approximate pixels of the longer side of views for ray ends
PIXELS = 4000  # pixels of each view for ray ends
FAINT_ALPHA = 0.02  # alpha below which a pixel counts as empty
DENSEST_OPACITY = 1 - 1e-6  # largest opacity of a point
LitCamera = tuple[Camera, Light]


class RayEnds(NamedTuple):
    """Where rays end: places, normals and colours [N, 3]."""

    places: Tensor
    normals: Tensor
    colors: Tensor


def ends_of_rays(
    caster: Caster, appearance: Appearance, tf: TransferFunction, cameras: list[Camera], most: int, seed: int
) -> RayEnds:
    """Return points where rays of random pixels lose a share of their light, different for each view.

    So there are as many ends on a layer as it shows, also behind others. They are on the CPU, `most` of them
    or fewer: small views are enough where they show so many.
    """
    unlit = caster.with_appearance(replace(appearance, step=1.0, ambient=1.0, diffuse=0.0, specular=0.0))
    glance = max(cameras[0].width, cameras[0].height) // GLANCE_SIZE
    for reduction in sorted({max(glance, 1), 1}, reverse=True):
        points = ends_in(unlit, tf, [smaller(camera, reduction) for camera in cameras], most, seed)
        if len(points.places) == most:
            break
    return points


def ends_in(caster: Caster, tf: TransferFunction, cameras: list[Camera], most: int, seed: int) -> RayEnds:
    """Return up to `most` ends of rays of views, along a Z curve."""
    generator = torch.Generator().manual_seed(seed)
    count, parts = len(cameras), []
    shares = (torch.randperm(count, generator=generator) + 0.5) / count  # spread evenly, in random order
    for camera, left in zip(cameras, shares.tolist(), strict=True):
        thick = thicken(tf, math.log(0.5) / math.log(left))  # half of the light remains where `left` did
        parts.append(ends_of(caster, thick, camera, generator))
    points = RayEnds(*map(torch.cat, zip(*parts, strict=True)))
    chosen = torch.randperm(len(points.places), generator=generator)[:most]
    ordered = chosen[z_order_of(points.places[chosen])]
    return RayEnds(*(x[ordered] for x in points))


def thicken(tf: TransferFunction, factor: float) -> TransferFunction:
    """Multiply the extinction of a function by a factor."""
    through = [(value, math.log1p(-min(alpha, DENSEST_OPACITY))) for value, alpha in tf.opacity]
    return tf.with_points([(value, -math.expm1(factor * x)) for value, x in through], tf.color)


def ends_of(caster: Caster, tf: TransferFunction, camera: Camera, generator: torch.Generator) -> RayEnds:
    """Return the points where rays of random pixels of one view lose half of their light, if they do."""
    seen = caster.cast(tf, camera, HEADLIGHT, ("median", "normal"))
    z, normals, rgba = seen.median.cpu(), seen.normal.cpu(), seen.rgba.cpu()  # type: ignore[union-attr]
    rows, columns = (rgba[..., 3] > FAINT_ALPHA).nonzero(as_tuple=True)
    some = torch.randperm(len(rows), generator=generator)[:PIXELS]
    rows, columns = rows[some], columns[some]
    ends = z[rows, columns] > 0
    at = rows[ends], columns[ends]
    rgba = rgba[at]
    return RayEnds(camera.unproject(z)[at], normals[at], (rgba[:, :3] / rgba[:, 3:]).clamp(0, 1))


def lit_cameras(lens: Lens, seed: int) -> list[LitCamera]:
    """Return cameras and lights of training views: every third a headlight, the others a random light."""
    cameras = icosphere(FREQUENCY, lens)
    random = random_lights(len(cameras), seed, 0)
    lights = [light if index % HEADLIGHT_INTERVAL else HEADLIGHT for index, light in enumerate(random)]
    return list(zip(cameras, lights, strict=True))


def cast_views(caster: Caster, tf: TransferFunction, lit: Sequence[LitCamera], title: str) -> Images:
    """Cast views of a function from cameras of one size."""
    cameras, lights = map(list, zip(*lit, strict=True))
    planes = torch.empty(len(cameras), 4, cameras[0].height, cameras[0].width, dtype=torch.uint8)
    for index, camera in enumerate(progress(cameras, title=title, unit="view")):
        seen = caster.cast(tf, camera, lights[index]).rgba.permute(2, 0, 1)
        over_white = torch.cat([seen[:3] + 1 - seen[3], seen[3:]])
        planes[index] = (255 * over_white).round_().clamp_(0, 255).to(torch.uint8)
    return Images(planes, cameras, lights)
