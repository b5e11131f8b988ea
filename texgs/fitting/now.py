"""A model of a transfer function in seconds: views cast in memory, surfels where rays end, short fits."""

from collections.abc import Iterator
from dataclasses import replace

import torch

from texgs.core.errors import ArgumentError
from texgs.core.lens import Lens
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import ShadingModel, in_full_light
from texgs.fitting.attributes import Attributes
from texgs.fitting.casting import HEADLIGHT_INTERVAL, cast_views, ends_of_rays, lit_cameras
from texgs.fitting.loop import fit_further
from texgs.fitting.seeds import surfels_on
from texgs.fitting.settings import Densify, Losses, Phase, Rates, TextureKeys
from texgs.fitting.texels import texturize
from texgs.volume.caster import Caster
from texgs.volume.render import Appearance
from texgs.volume.transfer import TransferFunction

SURFELS, OPACITY = 40_000, 0.05
MIN_POINTS = 100
CAST_INTERVAL = 2  # one in two views without a headlight is cast
SAMPLE_DISTANCE = 1.0  # voxels between the samples of views
PHASE = Phase(
    rates=Rates(quats=0.016, scales=0.05, opacities=0.1),
    losses=Losses(alpha=0.0),
    densify=Densify(stop=0),
)
PASSES = 400, 1000  # iterations of the first model, and of the finer one
TEXTURE = TextureKeys()


def fit_now(
    caster: Caster,
    appearance: Appearance,
    tf: TransferFunction,
    lens: Lens,
    title: str,
    seed: int = 0,
    *,
    soon: bool = True,
) -> Iterator[Surfels]:
    """Yield a quick textured model of a volume under a function, then a finer one.

    Surfels start where rays end, and as the volume has them there, see `Attributes`: nothing has to be found
    first, so that density control is not needed. Texels see the views under a headlight.

    Args:
        caster: of the volume.
        appearance: how it looks, as in the views of other models.
        tf: in data values.
        lens: of the training views.
        title: of progress bars.
        seed: of lights, first surfels and the order of views.
        soon: there is a first model; else the finer one alone, which is there earlier.

    Raises:
        ArgumentError: if the function shows nothing.
    """
    lit = lit_cameras(lens, seed)
    points = ends_of_rays(caster, appearance, tf, [camera for camera, _ in lit], SURFELS, seed)
    if len(points.places) < MIN_POINTS:
        raise ArgumentError("function: expected to see enough of the volume, got little; raise its opacity")
    others = [each for index, each in enumerate(lit) if index % HEADLIGHT_INTERVAL][::CAST_INTERVAL]
    chosen = [*lit[::HEADLIGHT_INTERVAL], *others]
    caster = caster.with_appearance(replace(appearance, step=SAMPLE_DISTANCE))
    images = cast_views(caster, tf, chosen, f"{title}, views")
    headlit = images[: len(chosen) - len(others)]
    shading = ShadingModel(local_viewer=caster.local_viewer)
    start = surfels_on(points, OPACITY, torch.Generator().manual_seed(seed))
    start = {name: x.to(caster.device) for name, x in start.items()}
    volume = Attributes.of(caster, appearance, tf, start["means"])
    model = Surfels(start | volume.start(start["means"], shading.material), shading)
    for number, iterations in enumerate(PASSES if soon else PASSES[-1:], 1):
        phase = replace(PHASE, iterations=iterations)
        model = fit_further(model, images, phase, seed, f"{title}, pass {number}", volume.held)
        lit_fully = replace(model, parameters=in_full_light(model.parameters, shading.material))
        yield texturize(lit_fully, headlit, TEXTURE, seed, f"{title}, texture")
