"""A model of a transfer function in seconds: views cast in memory, surfels where rays end, two short fits."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.geometry import facing
from texgs.core.lens import Lens
from texgs.core.light import HEADLIGHT, Light, random_lights
from texgs.core.progress import progress
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import ShadingModel, in_full_light, raw_material
from texgs.fitting.ends import FAINT, Points, ends_of_rays
from texgs.fitting.loop import Fit
from texgs.fitting.seeds import surfels_at
from texgs.fitting.settings import Densify, Losses, Phase, Rates, TextureKeys
from texgs.fitting.texels import texturize
from texgs.volume.cameras import icosphere
from texgs.volume.caster import Caster
from texgs.volume.images import Images, smaller
from texgs.volume.render import Appearance
from texgs.volume.transfer import TransferFunction

FREQUENCY = 4  # of the icosphere of cameras, of which it has 162
SURFELS, OPACITY = 20_000, 0.05
LEAST = 100  # points
HEADLIGHTS = 3  # one view of so many has a headlight, the others a light of their own
GLANCE = 3  # times smaller views, which say where rays end
RATES = Rates(quats=0.016, scales=0.05, opacities=0.1)
TEXTURE = TextureKeys()
LitCamera = tuple[Camera, Light]


class Effort(NamedTuple):
    """What two passes of a fit get."""

    step: float  # voxels between the samples of views
    reduce: int  # times smaller views of the first pass
    others: int  # of the views that have no headlight, one of so many is in the second pass
    iterations: tuple[int, int]


# Rays go far through translucent matter, which is smooth: its views take longest and need the fewest samples.
OPAQUE = Effort(step=0.5, reduce=1, others=1, iterations=(600, 1350))
TRANSLUCENT = Effort(step=1.0, reduce=2, others=2, iterations=(950, 1000))
MEAN_ALPHA = 0.7  # of what is seen: with less it is translucent


def fit_now(
    caster: Caster, look: Appearance, tf: TransferFunction, lens: Lens, title: str, seed: int = 0
) -> Iterator[Surfels]:
    """Yield a first textured model of what a function shows of a volume, then a finer one.

    The material starts at that of the volume, and surfels where its rays end, with its normals and colours:
    nothing has to be found first, so that density control is not needed. Texels see the views under a
    headlight.

    Args:
        caster: of the volume.
        look: how it looks, as in the views of other models.
        tf: in data values.
        lens: of the training views.
        title: of progress bars.
        seed: of lights, first surfels and the order of views.

    Raises:
        ArgumentError: if the function shows nothing.
    """
    glances = [smaller(camera, GLANCE) for camera in icosphere(FREQUENCY, lens)[::HEADLIGHTS]]
    points = ends_of_rays(caster, look, tf, glances, SURFELS, seed)
    if len(points.places) < LEAST:
        raise ArgumentError("function: expected to see enough of the volume, got little; raise its opacity")
    effort = TRANSLUCENT if mean_alpha(caster, tf, glances[::HEADLIGHTS]) < MEAN_ALPHA else OPAQUE
    caster = caster.with_appearance(replace(look, step=effort.step))
    lit = lit_cameras(lens, seed)
    headlit = cast_views(caster, tf, lit[::HEADLIGHTS], f"{title}, headlit views")
    shading = ShadingModel(local_viewer=caster.local_viewer)
    factors = (look.ambient, look.diffuse, look.specular, look.shininess)
    start = surfels_on(points, seed) | raw_material(*factors, kind=shading.material)
    parameters = {name: x.to(caster.device) for name, x in start.items()}
    for number, images in enumerate(views_of_passes(caster, tf, headlit, lit, effort, title)):
        named = f"{title}, pass {number + 1}"
        model = Surfels(parameters, shading)
        parameters = refined(model, images, effort.iterations[number], RATES, seed, named)
        model = Surfels(in_full_light(parameters, shading.material), shading)
        yield texturize(model, headlit, TEXTURE, seed, f"{title}, texture")


def views_of_passes(
    caster: Caster, tf: TransferFunction, headlit: Images, lit: list[LitCamera], effort: Effort, title: str
) -> Iterator[Images]:
    """Yield the views of the first pass, and of the second."""
    if effort.reduce > 1:
        reduced = [(smaller(camera, effort.reduce), light) for camera, light in lit]
        yield cast_views(caster, tf, reduced, f"{title}, smaller views")
    others = [each for index, each in enumerate(lit) if index % HEADLIGHTS][:: effort.others]
    images = joined(headlit, cast_views(caster, tf, others, f"{title}, other views"))
    yield images
    if effort.reduce == 1:
        yield images


def refined(
    model: Surfels, images: Images, iterations: int, rates: Rates, seed: int, title: str
) -> dict[str, Tensor]:
    """Return the parameters of surfels that were fitted to views, as many as before."""
    phase = Phase(iterations, rates=rates, losses=Losses(alpha=0.0), densify=Densify(stop=0))
    fit = Fit(model.parameters, model.shading, images, phase, seed)
    for _ in progress(fit.run(), iterations, title=title, unit="view"):
        pass
    return {name: x.detach() for name, x in fit.parameters.items()}


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


def joined(one: Images, other: Images) -> Images:
    """Return the views of both."""
    planes = torch.cat([one.planes, other.planes])
    return Images(planes, one.cameras + other.cameras, one.lights + other.lights)


def mean_alpha(caster: Caster, tf: TransferFunction, cameras: list[Camera]) -> float:
    """Return the mean alpha of what views show."""
    alphas = [caster.cast(tf, camera, HEADLIGHT).rgba[..., 3] for camera in cameras]
    seen = torch.cat([alpha[alpha > FAINT] for alpha in alphas])
    return float(seen.mean())


def surfels_on(points: Points, seed: int) -> dict[str, Tensor]:
    """Return raw parameters of surfels at points that face along their normals."""
    parameters = surfels_at(points.places, OPACITY, torch.Generator().manual_seed(seed))
    return {**parameters, "quats": facing(points.normals), "colors": points.colors}
