"""A series in time: the model of a step from that of the step before, of the same surfels and texels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import torch
from torch import Tensor
from torch.nn.functional import normalize

from texgs.core.errors import ArgumentError
from texgs.core.geometry import quats_to_matrices
from texgs.core.lens import Lens
from texgs.core.progress import progress
from texgs.fields.surfels.model import TEXTURE, Surfels
from texgs.fields.surfels.texels import untextured
from texgs.fitting.loop import Fit
from texgs.fitting.now import HEADLIGHTS, Points, cast_views, ends_of_rays, surfels_on
from texgs.fitting.now import RATES as RATES_OF_SEEDS
from texgs.fitting.seeds import shown
from texgs.fitting.settings import Densify, Losses, Phase, Rates
from texgs.volume.caster import Caster
from texgs.volume.framing import frame_of
from texgs.volume.grid import Grid
from texgs.volume.images import Images
from texgs.volume.motion import Motion, motion
from texgs.volume.render import Appearance
from texgs.volume.transfer import TransferFunction

SIZE = 128  # pixels of the views of a step: surfels have their places, views only say how far they are off
STEP = 1.0  # voxels between the samples of views
ITERATIONS = 400
SLOWER = 0.3  # times the rates of surfels that start anywhere
SHARE = 0.1  # of all surfels: so many of those that show least are planted where most is missing
HIDDEN = -12.0  # raw opacity of surfels where nothing is to be seen
FARTHEST, STRETCH = 0.05, 2.0  # world units at which the ends of axes are carried; and how much they stretch


def next_step(
    model: Surfels,
    before: Grid,
    after: Grid,
    look: Appearance,
    tf: TransferFunction,
    title: str,
    seed: int = 0,
) -> Surfels:
    """Return the model of a step of a series, from that of the step before.

    Surfels move with the matter that they show, see `motion`; those that show least are planted where matter
    has appeared, and a short fit to small views moves, turns, fades and colours all. There are as many as
    before, in their order, and texels and material stay: segments and textures of the one model are also
    those of the other.

    Args:
        model: of the step before, of stage shading or texture.
        before: its volume.
        after: the volume of the step, on the same lattice.
        look: how both look.
        tf: what the model shows, in data values.
        title: of progress bars.
        seed: of lights, planted surfels and the order of views; another one for each step.

    Raises:
        ArgumentError: if the volumes lie on other lattices, or the model has no shading yet.
    """
    if (after.dims, after.spacing) != (before.dims, before.spacing):
        raise ArgumentError(
            f"expected the samples of the step before, {before.dims} with spacing {before.spacing}, got "
            f"{after.dims} with {after.spacing}; resample the volume"
        )
    if "ambient" not in model.parameters:
        raise ArgumentError(f"model: expected stage shading or texture, got {model.stage}; fit it further")
    lens = lens_of(after, tf)
    if lens is None:
        hidden = torch.full_like(model.parameters["opacities"], HIDDEN)
        return replace(model, parameters={**model.parameters, "opacities": hidden})
    flat, texture = without_texture(model)
    if lens_of(before, tf):
        flat = carried(flat, motion(before, after, tf))
    caster = Caster(after, replace(look, step=STEP), model.device)
    images = cast_views(caster, tf, lens, title, seed)
    some = slice(None, None, HEADLIGHTS)
    few = Images(images.planes[some], images.cameras[some], images.lights[some])
    weights = shown(Surfels(flat, model.shading), few)
    flat = planted(flat, ends_of_rays(caster, look, tf, images, seed), weights, seed)
    phase = Phase(ITERATIONS, rates=RATES, losses=Losses(alpha=0.0), densify=Densify(stop=0))
    fit = Fit(flat, model.shading, images, phase, seed)
    for _ in progress(fit.run(), ITERATIONS, title=title, unit="view"):
        pass
    fitted = {name: x.detach() for name, x in fit.parameters.items()}
    fitted["colors"] = fitted["colors"] - texture
    return replace(model, parameters={**model.parameters, **fitted})


RATES = Rates(
    means=SLOWER * RATES_OF_SEEDS.means,
    quats=SLOWER * RATES_OF_SEEDS.quats,
    scales=SLOWER * RATES_OF_SEEDS.scales,
    opacities=SLOWER * RATES_OF_SEEDS.opacities,
    colors=SLOWER * RATES_OF_SEEDS.colors,
    material=0.0,
)


def lens_of(grid: Grid, tf: TransferFunction) -> Lens | None:
    """Return the lens of small views of all that a function shows; None where that is nothing."""
    try:
        return frame_of(grid, [tf]).lens(width=SIZE, height=SIZE)
    except ArgumentError:
        return None


def without_texture(model: Surfels) -> tuple[dict[str, Tensor], Tensor]:
    """Return the parameters with plain colours, and what of these [N, 3] is palette and mean texel."""
    p = {name: x for name, x in model.parameters.items() if name not in TEXTURE}
    if model.stage != "texture":
        return p, torch.zeros_like(p["colors"])
    plain = untextured(model).parameters
    texture = plain["palette"] + plain["texels"][plain["offsets"]]
    return {**p, "colors": p["colors"] + texture}, texture


def carried(parameters: Mapping[str, Tensor], moves: Motion) -> dict[str, Tensor]:
    """Return surfels that move with matter: their middles, and the ends of their axes, which turns them.

    Axes stay at right angles: the first keeps its direction, the second its plane.
    """
    p = parameters
    axes = quats_to_matrices(p["quats"])[..., :2]  # [N, 3, 2]
    reach = p["scales"].exp().clamp_max(FARTHEST)
    arms = [reach[:, k, None] * axes[..., k] for k in range(2)]
    first, second = (arm + (moves.at(p["means"] + arm) - moves.at(p["means"] - arm)) / 2 for arm in arms)
    stretch = torch.stack([first.norm(dim=1), second.norm(dim=1)], dim=1) / reach
    return {
        **p,
        "means": p["means"] + moves.at(p["means"]),
        "quats": spanning(first, second),
        "scales": p["scales"] + stretch.clamp(1 / STRETCH, STRETCH).log(),
    }


def spanning(first: Tensor, second: Tensor) -> Tensor:
    """Return quaternions [N, 4] wxyz that turn x to one vector [N, 3], and y into its plane with another."""
    from kornia.geometry.conversions import rotation_matrix_to_quaternion

    x = normalize(first, dim=1)
    z = normalize(torch.linalg.cross(first, second), dim=1)
    quats: Tensor = rotation_matrix_to_quaternion(torch.stack([x, torch.linalg.cross(z, x), z], dim=2))
    return quats


def planted(
    parameters: Mapping[str, Tensor], points: Points, weights: Tensor, seed: int
) -> dict[str, Tensor]:
    """Return surfels of which those that show least are new ones, at the points that are farthest from any.

    Args:
        parameters: of surfels with plain colours.
        points: where rays end.
        weights: [N] what views show of each surfel; all that are not seen move, too.
        seed: of turns around normals.
    """
    from scipy.spatial import cKDTree

    n = len(weights)
    count = min(max(int(SHARE * n), int((weights <= 0).sum())), len(points.places))
    least = weights.argsort()[:count]
    kept = torch.ones(n, dtype=torch.bool).index_fill_(0, least, False)
    distances, _ = cKDTree(parameters["means"][kept].numpy()).query(points.places.numpy())
    far = torch.from_numpy(distances).argsort(descending=True)[:count]
    new = {name: x[far] for name, x in surfels_on(points, seed).items()}
    return {name: x.index_copy(0, least, new[name]) if name in new else x for name, x in parameters.items()}
