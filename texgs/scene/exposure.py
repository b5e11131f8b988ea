"""How much light reaches the surfels of a scene through its volume.

A surfel stands for the matter around it, which rays from outside reach at different depths. So its light is
that of these depths, and not that of its own place: below an opaque surface, where surfels show through gaps
between others, it would lie in the dark of its own matter, and surfaces would be speckled.
"""

import torch
from torch import Tensor

from texgs.core.camera import orbit_direction
from texgs.core.errors import ArgumentError
from texgs.core.light import Light
from texgs.fields.field import Composed
from texgs.fields.files import kind_of
from texgs.fields.surfels.composition import Composition
from texgs.scene.scene import Scene
from texgs.scene.twin import Twin, is_seen, last_of
from texgs.volume.light_cells import LightCells
from texgs.volume.matter import Matter

REACH = 2.0  # cells to both sides of a surfel, within which matter belongs to it
STEP = 0.5  # cells
MEAN_SLANT = 1.5  # length of a ray by depth below a surface: the mean cosine of surfaces that are seen is 2/3
CLEAR = 1e-4  # share of light; matter that takes away less leaves a surfel where it is

NO_VOLUME = (
    "light: expected the volume of the scene for shadows and occlusion, got none; make the scene again by "
    "texgs compose, or take both back by shadows=0 occlusion=0"
)


def exposed(composed: Composed, scene: Scene, twin: Twin | None) -> Composed:
    """Return the models of a scene where its light reaches them; see `exposure_of`."""
    exposure = exposure_of(composed, scene, twin)
    return (
        composed.under(exposure) if isinstance(composed, Composition) and exposure is not None else composed
    )


def exposure_of(composed: Composed, scene: Scene, twin: Twin | None) -> Tensor | None:
    """Return factors [N, 2] on the lamp's and on ambient light of each primitive, or None without shadows.

    They are kept while only the camera moves. What no model shows of the volume hides nothing.

    Raises:
        ArgumentError: if there is no volume, or these primitives cannot be relit.
    """
    light = scene.light
    if not light.casts_shadows or not any(is_seen(model.edit) for model in scene.models.values()):
        return None
    if twin is None:
        raise ArgumentError(NO_VOLUME)
    if not isinstance(composed, Composition):
        raise baked_light(kind_of(next(iter(scene.models.values())).file).name)
    cells, matter = twin.light_cells(scene, composed.palettes), twin.matter(scene, composed.palettes)
    places = last_of(twin.places, (composed, matter), lambda: places_of(composed, matter))

    def make() -> Tensor:
        exposure = composed.means.new_ones(len(composed), 2)
        if light.shadows and light.kind == "directional":
            exposure[:, 0] -= light.shadows * (1 - lamp_shares(composed, light, cells, places))
        if light.occlusion:
            state = composed, matter, light.reach
            sky = last_of(twin.sky, state, lambda: sky_shares(composed, cells, places))
            exposure[:, 1] -= light.occlusion * (1 - sky)
        return exposure

    return last_of(twin.exposures, (composed, cells, light), make)


def baked_light(kind: str) -> ArgumentError:
    """Return the error for shadows on fields that cannot be relit."""
    return ArgumentError(
        f"light: expected surfels for shadows and occlusion, got {kind}, which have light in their colours; "
        "fit surfels, or take both back by shadows=0 occlusion=0"
    )


def require_shadows(scene: Scene) -> None:
    """Require what shadows and occlusion need: models that can be relit, and a volume."""
    kind = kind_of(next(iter(scene.models.values())).file)
    if "relight" not in kind.can:
        raise baked_light(kind.name)
    if scene.volume is None:
        raise ArgumentError(NO_VOLUME)


def lamp_shares(composed: Composition, light: Light, cells: LightCells, places: Tensor) -> Tensor:
    """Return which share [N] of a directional light reaches surfels, on the side that faces it."""
    direction = orbit_direction(light.azimuth, light.polar).to(composed.normals)
    is_ahead = composed.normals @ direction > 0
    along = torch.where(is_ahead, places[0], places[1])
    return outside(composed, cells, along, torch.where(is_ahead, 1.0, -1.0))[:, 0]


def sky_shares(composed: Composition, cells: LightCells, places: Tensor) -> Tensor:
    """Return which share [N] of ambient light reaches surfels, on the side where that is more.

    For opaque matter it is the side that is seen.
    """
    ahead, behind = (outside(composed, cells, *each)[:, 1] for each in zip(places, (1.0, -1.0), strict=True))
    return torch.maximum(ahead, behind)


def outside(composed: Composition, cells: LightCells, along: Tensor, side: Tensor | float) -> Tensor:
    """Return the shares [N, 2] outside of surfels: means over two places [2, N] on one side, 1 or -1."""
    steps = side * (along + cells.outset)
    points = (torch.addcmul(composed.means, step[:, None], composed.normals) for step in steps)
    before, after = (cells.at(each) for each in points)
    return 0.5 * (before + after)


def places_of(composed: Composition, matter: Matter) -> Tensor:
    """Return where rays from outside are absorbed near surfels, [2, 2, N] world units out of the surface.

    The first axis is the side that rays come from: that of the normal, and the other one. The second are two
    places, one standard deviation before and behind the mean: the mean of what is there is that of all
    depths, as far as it is a parabola between them.
    """
    count = round(REACH / STEP)
    steps = torch.arange(count, -count - 1, -1, device=composed.device) * (STEP * matter.edge)
    normals = composed.normals
    met = torch.stack([matter.at(composed.means + step * normals) for step in steps.tolist()])
    met *= STEP * MEAN_SLANT
    return torch.stack([absorbed(each, steps) for each in (met, met.flip(0))])


def absorbed(met: Tensor, steps: Tensor) -> Tensor:
    """Return where rays are absorbed, [2, N] of `places_of`, from the extinctions [K, N] that they meet."""
    through = torch.exp2(-torch.cumsum(met, dim=0))
    weights = torch.cat([1 - through[:1], through[:-1] - through[1:]])
    taken = 1 - through[-1]
    weights = torch.where(taken > CLEAR, weights / taken.clamp_min(CLEAR), (steps == 0).float()[:, None])
    mean = (weights * steps[:, None]).sum(dim=0)
    spread = (weights * (steps[:, None] - mean) ** 2).sum(dim=0).sqrt()
    return torch.stack([mean + spread, mean - spread])
