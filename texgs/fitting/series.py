"""A series in time: the model of a step from that of the step before, of the same surfels and texels."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import normalize

from texgs.core.errors import ArgumentError
from texgs.core.geometry import nearest, quats_to_matrices
from texgs.core.lens import Lens
from texgs.fields.surfels.model import TEXTURE, Surfels
from texgs.fields.surfels.step_file import UNITS
from texgs.fields.surfels.texels import untextured
from texgs.fitting.casting import HEADLIGHTS, RayEnds, cast_views, ends_of_rays, lit_cameras
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

VIEW_SIZE = (
    128  # pixels of the views of a step: surfels have their places, views only say how far they are off
)
SAMPLE_DISTANCE = 1.0  # voxels between the samples of views
ROUNDS = 3  # through all views: a part of one would bend surfels towards the views that are in it
SLOWER = 0.3  # times the rates of surfels that start anywhere
MOVED = UNITS.keys() - {"normals"}  # these turn as fast as surfels
RATES = Rates(**{name: SLOWER * getattr(PHASE.rates, name) for name in MOVED}, material=0.0)
PLANTED_SHARE = 0.1  # share of all surfels: those that show least are planted where most is missing
FEWEST_PLANTED = 4  # surfels to plant: of fewer the size is not known, see `surfels_at`
HIDDEN_LOGIT = -12.0  # raw opacity of surfels where nothing is to be seen
FARTHEST, STRETCH = 0.05, 2.0  # world units at which the ends of axes are carried; and how much they stretch


class Follower:
    """Follows what a function shows, from one volume of a series to the next.

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
        """Return the model of a step, whose volume is `after`, from that of a step beside it.

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
        plain = {name: x for name, x in p.items() if name not in TEXTURE}
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
        headlit = images[::HEADLIGHTS]
        points = ends_of_rays(caster, self._appearance, self._tf, headlit.cameras, SURFELS, seed)
        weights = visible_weights(Surfels(plain, self._shading).to(caster.device), headlit).cpu()
        model = Surfels(plant(plain, points, weights, seed), self._shading).to(caster.device)
        phase = replace(PHASE, iterations=ROUNDS * len(images), rates=RATES)
        return dict(fit_further(model, images, phase, seed, title).parameters)


def lens_of(grid: Grid, tf: TransferFunction) -> Lens | None:
    """Return the lens of small views of all that a function shows; None where that is nothing."""
    try:
        return frame_of(grid, [tf]).lens(width=VIEW_SIZE, height=VIEW_SIZE)
    except ArgumentError:
        return None


def mean_texture(model: Surfels) -> Tensor:
    """Return palette and mean texel [N, 3]: what the colours of a model are offsets from."""
    if model.stage != "texture":
        return torch.zeros_like(model.parameters["colors"])
    plain = untextured(model).parameters
    return plain["palette"] + plain["texels"][plain["offsets"]]


def carry(parameters: Mapping[str, Tensor], moves: Motion) -> dict[str, Tensor]:
    """Return surfels that move with matter: their middles, and the ends of their axes, which turns them.

    Axes stay at right angles: the first keeps its direction, the second its plane.
    """
    p = parameters
    axes = quats_to_matrices(p["quats"])[..., :2]  # [N, 3, 2]
    reach = p["scales"].exp().clamp_max(FARTHEST)
    arms = [reach[:, k, None] * axes[..., k] for k in range(2)]
    first, second = (arm + (moves.at(p["means"] + arm) - moves.at(p["means"] - arm)) / 2 for arm in arms)
    stretch = torch.stack([first.norm(dim=1), second.norm(dim=1)], dim=1) / reach
    quats = spanning(first, second)
    return {
        **p,
        **turn_normals(p, quats),
        "means": p["means"] + moves.at(p["means"]),
        "quats": quats,
        "scales": p["scales"] + stretch.clamp(1 / STRETCH, STRETCH).log(),
    }


def turn_normals(parameters: Mapping[str, Tensor], quats: Tensor) -> dict[str, Tensor]:
    """Return normals, where surfels have their own, turned as these turn to new quaternions [N, 4]."""
    from kornia.geometry.conversions import rotation_matrix_to_quaternion

    if "normals" not in parameters:
        return {}
    before, normals = (quats_to_matrices(parameters[name]) for name in ("quats", "normals"))
    turn = quats_to_matrices(quats) @ before.mT
    return {"normals": rotation_matrix_to_quaternion((turn @ normals).contiguous())}


def spanning(first: Tensor, second: Tensor) -> Tensor:
    """Return quaternions [N, 4] wxyz that turn x to one vector [N, 3], and y into its plane with another."""
    from kornia.geometry.conversions import rotation_matrix_to_quaternion

    x = normalize(first, dim=1)
    z = normalize(torch.linalg.cross(first, second), dim=1)
    quats: Tensor = rotation_matrix_to_quaternion(torch.stack([x, torch.linalg.cross(z, x), z], dim=2))
    return quats


def plant(parameters: Mapping[str, Tensor], points: RayEnds, weights: Tensor, seed: int) -> dict[str, Tensor]:
    """Return surfels of which those that show least are new ones, at the points that are farthest from any.

    Weights [N] are what views show of each; all that are not seen move, too. Colours are plain ones.
    """
    n = len(weights)
    count = min(max(int(PLANTED_SHARE * n), int((weights <= 0).sum())), len(points.places))
    if count < FEWEST_PLANTED:  # matter that is about to come or go
        return {**parameters}
    least = weights.argsort()[:count]
    kept = torch.ones(n, dtype=torch.bool).index_fill_(0, least, False)
    distances, _ = nearest(parameters["means"][kept], points.places)
    far = distances.argsort(descending=True)[:count]
    start = surfels_on(points, OPACITY, torch.Generator().manual_seed(seed)) | {"colors": points.colors}
    new = {name: x[far] for name, x in start.items()}
    new["normals"] = new["quats"]
    return {name: x.index_copy(0, least, new[name]) if name in new else x for name, x in parameters.items()}
