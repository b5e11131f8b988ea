"""What a volume shows of a function, for fits: views that are cast, and the places where their rays end."""

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

FREQUENCY = 4  # frequency of the icosphere of cameras, which has 162
HEADLIGHTS = 3  # one view of so many has a headlight, the others a light of their own
GLANCE_SIZE = 64  # pixels of the longer side of views whose rays are followed, about
PIXELS = 4000  # pixels of each view whose rays are followed
FAINT_ALPHA = 0.02  # alpha below which a pixel shows nothing to speak of
DENSEST_OPACITY = 1 - 1e-6  # opacity of a point
LitCamera = tuple[Camera, Light]


class RayEnds(NamedTuple):
    """Where rays end: places, normals and colours [N, 3]."""

    places: Tensor
    normals: Tensor
    colors: Tensor


def ends_of_rays(
    caster: Caster, appearance: Appearance, tf: TransferFunction, cameras: list[Camera], most: int, seed: int
) -> RayEnds:
    """Return where rays of random pixels lose some part of their light, another one in each view.

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
    """Return where rays of views end, `most` of them or fewer, along a Z curve."""
    generator = torch.Generator().manual_seed(seed)
    count, parts = len(cameras), []
    shares = (torch.randperm(count, generator=generator) + 0.5) / count  # spread evenly, in random order
    for camera, left in zip(cameras, shares.tolist(), strict=True):
        thick = thicken(tf, math.log(0.5) / math.log(left))  # half of its light is left where `left` was
        parts.append(ends_of(caster, thick, camera, generator))
    points = RayEnds(*map(torch.cat, zip(*parts, strict=True)))
    chosen = torch.randperm(len(points.places), generator=generator)[:most]
    ordered = chosen[z_order_of(points.places[chosen])]
    return RayEnds(*(x[ordered] for x in points))


def thicken(tf: TransferFunction, factor: float) -> TransferFunction:
    """Return a function of a factor's extinction."""
    through = [(value, math.log1p(-min(alpha, DENSEST_OPACITY))) for value, alpha in tf.opacity]
    return tf.with_points([(value, -math.expm1(factor * x)) for value, x in through], tf.color)


def ends_of(caster: Caster, tf: TransferFunction, camera: Camera, generator: torch.Generator) -> RayEnds:
    """Return where rays of random pixels of one view lose half of their light, as far as they do."""
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
    """Return the cameras of training views: every third has a headlight, the others a random light."""
    cameras = icosphere(FREQUENCY, lens)
    random = random_lights(len(cameras), seed, 0)
    lights = [light if index % HEADLIGHTS else HEADLIGHT for index, light in enumerate(random)]
    return list(zip(cameras, lights, strict=True))


def cast_views(caster: Caster, tf: TransferFunction, lit: Sequence[LitCamera], title: str) -> Images:
    """Cast what a function shows, from cameras of one size."""
    cameras, lights = map(list, zip(*lit, strict=True))
    planes = torch.empty(len(cameras), 4, cameras[0].height, cameras[0].width, dtype=torch.uint8)
    for index, camera in enumerate(progress(cameras, title=title, unit="view")):
        seen = caster.cast(tf, camera, lights[index]).rgba.permute(2, 0, 1)
        over_white = torch.cat([seen[:3] + 1 - seen[3], seen[3:]])
        planes[index] = (255 * over_white).round_().clamp_(0, 255).to(torch.uint8)
    return Images(planes, cameras, lights)
