"""Follow a series in time: the model of a step from its neighbour's, with the same surfels and texels."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import normalize

from texgs.core.errors import ArgumentError
from texgs.core.geometry import nearest, quats_to_matrices
from texgs.core.lens import Lens
from texgs.fields.surfels.model import TEXTURE_TENSORS, Surfels
from texgs.fields.surfels.step_file import UNITS
from texgs.fields.surfels.texels import with_single_texels
from texgs.fitting.casting import HEADLIGHT_INTERVAL, RayEnds, cast_views, ends_of_rays, lit_cameras
from texgs.fitting.loop import fit_further
from texgs.fitting.now import OPACITY, PHASE, SURFELS
from texgs.fitting.seeds import surfels_on, visible_weights
from texgs.fitting.settings import Rates
from texgs.volume.caster import Caster
from texgs.volume.framing import frame_of
from texgs.volume.grid import Grid
from texgs.volume.motion import Motion, motion
from texgs.volume.render import Appearance
from texgs.volume.transfer import TransferFunction

VIEW_SIZE = 128  # pixels of a step's views; they only correct the surfels' places
SAMPLE_DISTANCE = 1.0  # voxels between the samples of views
ROUNDS = 3  # passes over all views; a partial one would favour the views in it
RATE_FACTOR = 0.3  # relative to the rates of a fit from seeds
MOVING_RATES = UNITS.keys() - {"normals"}  # normals turn as fast as surfels
RATES = Rates(**{name: RATE_FACTOR * getattr(PHASE.rates, name) for name in MOVING_RATES}, material=0.0)
PLANTED_SHARE = 0.1  # share of surfels, the least visible, to plant where most is missing
MIN_PLANTED = 4  # surfels to plant; for fewer the size is unknown, see `surfels_at`
HIDDEN_LOGIT = -12.0  # raw opacity of surfels at an invisible step
# World units at which the ends of axes are carried; and how much they stretch.
MAX_DISPLACEMENT, MAX_STRETCH = 0.05, 2.0


class Follower:
    """Follows a model through a series, from one volume to the next.

    Surfels move with the matter that they show, see `motion`; those that show least are planted where matter
    has appeared, and a short fit to small views moves, turns, fades and colours all. There are as many as
    before, in their order, and texels and material stay: segments and textures of one step are also those of
    another.

    Args:
        key: the model of any step, of stage shading or texture.
        appearance: how volumes look.
        tf: what the model shows, in data values.
    """

    def __init__(self, key: Surfels, appearance: Appearance, tf: TransferFunction) -> None:
        if "ambient" not in key.parameters:
            raise ArgumentError(f"model: expected stage shading or texture, got {key.stage}; fit it further")
        self._shading, self._appearance, self._tf = key.shading, appearance, tf
        self._texture = mean_texture(key.to("cpu"))

    def step(self, model: Surfels, before: Grid, after: Grid, title: str, seed: int = 0) -> Surfels:
        """Return the model of a step with the volume `after`, from the model of a neighbouring step.

        Titles are those of progress bars. The seed is that of lights, planted surfels and the order of views:
        another one for each step. Volumes on different lattices are refused.
        """
        if after.dims != before.dims or not np.allclose(after.spacing, before.spacing):
            raise ArgumentError(
                f"expected the samples of the other steps, {before.dims} with spacing {before.spacing}, got "
                f"{after.dims} with {after.spacing}; resample the volume"
            )
        p, device = model.to("cpu").parameters, model.device
        lens = lens_of(after, self._tf)
        if lens is None:
            hidden = torch.full_like(model.parameters["opacities"], HIDDEN_LOGIT)
            return replace(model, parameters={**model.parameters, "opacities": hidden})
        plain = {name: x for name, x in p.items() if name not in TEXTURE_TENSORS}
        plain["colors"] = plain["colors"] + self._texture
        if lens_of(before, self._tf):
            plain = carry(plain, motion(before, after, self._tf))
        caster = Caster(after, replace(self._appearance, step=SAMPLE_DISTANCE), device)
        fitted = self._fitted(plain, caster, lens, title, seed)
        fitted["colors"] = fitted["colors"] - self._texture.to(device)
        return replace(model, parameters={**model.parameters, **fitted})

    def _fitted(
        self, plain: Mapping[str, Tensor], caster: Caster, lens: Lens, title: str, seed: int
    ) -> dict[str, Tensor]:
        """Plant surfels without texels, and fit all to views of a volume."""
        images = cast_views(caster, self._tf, lit_cameras(lens, seed), f"{title}, views")
        headlit = images[::HEADLIGHT_INTERVAL]
        points = ends_of_rays(caster, self._appearance, self._tf, headlit.cameras, SURFELS, seed)
        weights = visible_weights(Surfels(plain, self._shading).to(caster.device), headlit).cpu()
        model = Surfels(plant(plain, points, weights, seed), self._shading).to(caster.device)
        phase = replace(PHASE, iterations=ROUNDS * len(images), rates=RATES)
        return dict(fit_further(model, images, phase, seed, title).parameters)


def lens_of(grid: Grid, tf: TransferFunction) -> Lens | None:
    """Return the lens of small views of a function, or None if it shows nothing."""
    try:
        return frame_of(grid, [tf]).lens(width=VIEW_SIZE, height=VIEW_SIZE)
    except ArgumentError:
        return None


def mean_texture(model: Surfels) -> Tensor:
    """Return palette plus mean texel [N, 3], the base of a model's colour offsets."""
    if model.stage != "texture":
        return torch.zeros_like(model.parameters["colors"])
    plain = with_single_texels(model).parameters
    return plain["palette"] + plain["texels"][plain["offsets"]]


def carry(parameters: Mapping[str, Tensor], moves: Motion) -> dict[str, Tensor]:
    """Move surfels with matter: their centres, and the ends of their axes, which turns them.

    Axes stay at right angles: the first keeps its direction, the second its plane.
    """
    p = parameters
    axes = quats_to_matrices(p["quats"])[..., :2]  # [N, 3, 2]
    reach = p["scales"].exp().clamp_max(MAX_DISPLACEMENT)
    arms = [reach[:, k, None] * axes[..., k] for k in range(2)]
    first, second = (arm + (moves.at(p["means"] + arm) - moves.at(p["means"] - arm)) / 2 for arm in arms)
    stretch = torch.stack([first.norm(dim=1), second.norm(dim=1)], dim=1) / reach
    quats = spanning_normals(first, second)
    return {
        **p,
        **turn_normals(p, quats),
        "means": p["means"] + moves.at(p["means"]),
        "quats": quats,
        "scales": p["scales"] + stretch.clamp(1 / MAX_STRETCH, MAX_STRETCH).log(),
    }


def turn_normals(parameters: Mapping[str, Tensor], quats: Tensor) -> dict[str, Tensor]:
    """Turn the normals of surfels, if any, with the surfels to new quaternions [N, 4]."""
    from kornia.geometry.conversions import rotation_matrix_to_quaternion

    if "normals" not in parameters:
        return {}
    before, normals = (quats_to_matrices(parameters[name]) for name in ("quats", "normals"))
    turn = quats_to_matrices(quats) @ before.mT
    return {"normals": rotation_matrix_to_quaternion((turn @ normals).contiguous())}


def spanning_normals(first: Tensor, second: Tensor) -> Tensor:
    """Return quaternions [N, 4] wxyz that map x to one vector [N, 3] and y into its plane with another."""
    from kornia.geometry.conversions import rotation_matrix_to_quaternion

    x = normalize(first, dim=1)
    z = normalize(torch.linalg.cross(first, second), dim=1)
    quats: Tensor = rotation_matrix_to_quaternion(torch.stack([x, torch.linalg.cross(z, x), z], dim=2))
    return quats


def plant(parameters: Mapping[str, Tensor], points: RayEnds, weights: Tensor, seed: int) -> dict[str, Tensor]:
    """Replace the least visible surfels by new ones, at the points farthest from all surfels.

    Weights [N] measure visibility; all invisible surfels move, too. Colours are unlit.
    """
    n = len(weights)
    count = min(max(int(PLANTED_SHARE * n), int((weights <= 0).sum())), len(points.places))
    if count < MIN_PLANTED:  # matter that appears or disappears
        return {**parameters}
    least = weights.argsort()[:count]
    kept = torch.ones(n, dtype=torch.bool).index_fill_(0, least, False)
    distances, _ = nearest(parameters["means"][kept], points.places)
    far = distances.argsort(descending=True)[:count]
    start = surfels_on(points, OPACITY, torch.Generator().manual_seed(seed)) | {"colors": points.colors}
    new = {name: x[far] for name, x in start.items()}
    new["normals"] = new["quats"]
    return {name: x.index_copy(0, least, new[name]) if name in new else x for name, x in parameters.items()}
