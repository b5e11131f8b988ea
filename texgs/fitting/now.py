"""A model of a transfer function in seconds: views cast in memory, surfels where rays end, short fits."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import torch

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.lens import Lens
from texgs.core.light import HEADLIGHT, Light, random_lights
from texgs.core.progress import progress
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import ShadingModel, in_full_light
from texgs.fitting.attributes import Attributes
from texgs.fitting.ends import ends_of_rays
from texgs.fitting.loop import Fit
from texgs.fitting.seeds import surfels_on
from texgs.fitting.settings import Densify, Losses, Phase, Rates, TextureKeys
from texgs.fitting.texels import texturize
from texgs.volume.cameras import icosphere
from texgs.volume.caster import Caster
from texgs.volume.images import Images
from texgs.volume.render import Appearance
from texgs.volume.transfer import TransferFunction

FREQUENCY = 4  # of the icosphere of cameras, of which it has 162
SURFELS, OPACITY = 40_000, 0.05
LEAST = 100  # points
HEADLIGHTS = 3  # one view of so many has a headlight, the others a light of their own
OTHERS = 2  # of the views that have no headlight, one of so many is cast
STEP = 1.0  # voxels between the samples of views
PHASE = Phase(
    rates=Rates(quats=0.016, scales=0.05, opacities=0.1),
    losses=Losses(alpha=0.0),
    densify=Densify(stop=0),
)
PASSES = 400, 1000  # iterations of the first model, and of the finer one
TEXTURE = TextureKeys()
LitCamera = tuple[Camera, Light]


def fit_now(
    caster: Caster,
    look: Appearance,
    tf: TransferFunction,
    lens: Lens,
    title: str,
    seed: int = 0,
    *,
    soon: bool = True,
) -> Iterator[Surfels]:
    """Yield a first textured model of what a function shows of a volume, then a finer one.

    Surfels start where rays end, and as the volume has them there, see `Attributes`: nothing has to be found
    first, so that density control is not needed. Texels see the views under a headlight.

    Args:
        caster: of the volume.
        look: how it looks, as in the views of other models.
        tf: in data values.
        lens: of the training views.
        title: of progress bars.
        seed: of lights, first surfels and the order of views.
        soon: there is a first model; else the finer one alone, which is there earlier.

    Raises:
        ArgumentError: if the function shows nothing.
    """
    lit = lit_cameras(lens, seed)
    points = ends_of_rays(caster, look, tf, [camera for camera, _ in lit], SURFELS, seed)
    if len(points.places) < LEAST:
        raise ArgumentError("function: expected to see enough of the volume, got little; raise its opacity")
    others = [each for index, each in enumerate(lit) if index % HEADLIGHTS][::OTHERS]
    chosen = [*lit[::HEADLIGHTS], *others]
    caster = caster.with_appearance(replace(look, step=STEP))
    images = cast_views(caster, tf, chosen, f"{title}, views")
    headlit = images[: len(chosen) - len(others)]
    shading = ShadingModel(local_viewer=caster.local_viewer)
    start = surfels_on(points, OPACITY, torch.Generator().manual_seed(seed))
    start = {name: x.to(caster.device) for name, x in start.items()}
    volume = Attributes.of(caster, look, tf, start["means"])
    model = Surfels(start | volume.start(start["means"], shading.material), shading)
    for number, iterations in enumerate(PASSES if soon else PASSES[-1:], 1):
        phase = replace(PHASE, iterations=iterations)
        model = refined(model, images, phase, seed, f"{title}, pass {number}", volume.held)
        lit_fully = replace(model, parameters=in_full_light(model.parameters, shading.material))
        yield texturize(lit_fully, headlit, TEXTURE, seed, f"{title}, texture")


def refined(
    model: Surfels, images: Images, phase: Phase, seed: int, title: str, held: Attributes | None = None
) -> Surfels:
    """Return a model of a phase that starts with another one."""
    fit = Fit(model.parameters, model.shading, images, phase, seed, held)
    for _ in progress(fit.run(), phase.iterations, title=title, unit="view"):
        pass
    return replace(model, parameters={name: x.detach() for name, x in fit.fitted.items()})


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
