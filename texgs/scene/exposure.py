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
from texgs.fields.surfels.composition import Composition
from texgs.scene.scene import Scene
from texgs.scene.twin import Twin, last_of
from texgs.volume.light_cells import LightCells
from texgs.volume.matter import Matter

REACH = 2.0  # cells to both sides of a surfel, within which matter belongs to it
STEP = 0.5  # cells
MEAN_SLANT = 1.5  # length of a ray by depth below a surface: the mean cosine of surfaces that are seen is 2/3
CLEAR = 1e-4  # share of light; matter that takes away less leaves a surfel where it is


def exposure_of(composed: Composed, scene: Scene, twin: Twin | None) -> Tensor | None:
    """Return factors [N, 2] on the lamp's and on ambient light of each primitive, or None without shadows.

    They are kept while only the camera moves.

    Raises:
        ArgumentError: if there is no volume, or these primitives cannot be relit.
    """
    light = scene.light
    if not light.casts_shadows:
        return None
    if twin is None:
        raise ArgumentError(
            "light: expected the volume of the scene for shadows and occlusion, got none; make the scene "
            "again by texgs compose, or take both back by shadows=0 occlusion=0"
        )
    if not isinstance(composed, Composition):
        return torch.ones(len(composed), 2, device=composed.device)  # is refused
    cells, matter = twin.light_cells(scene, composed.palettes), twin.matter(scene, composed.palettes)
    places = last_of(twin.places, (composed, matter), lambda: places_of(composed, matter))

    def make() -> Tensor:
        shares = shares_of(composed, light, cells, places)
        return 1 - shares.new_tensor([light.shadows, light.occlusion]) * (1 - shares)

    return last_of(twin.exposures, (composed, cells, light), make)


def shares_of(composed: Composition, light: Light, cells: LightCells, places: Tensor) -> Tensor:
    """Return which shares [N, 2] of the lamp's and of ambient light reach surfels.

    The lamp shines on the side of a surfel that faces it. Ambient light is that of the lighter side, which
    for opaque matter is the side that is seen.

    Args:
        composed: the surfels.
        light: of any kind; a headlight reaches all that is seen.
        cells: which shares reach them.
        places: of the surfels' matter, see `places_of`.
    """
    normals, outset = composed.normals, cells.outset
    sides = []
    for towards, along in ((1, places[0]), (-1, places[1])):
        points = (composed.means + towards * (each + outset)[:, None] * normals for each in along)
        sides.append(torch.stack([cells.at(each) for each in points]).mean(dim=0))
    ahead, behind = sides
    shares = torch.maximum(ahead, behind)
    if light.kind == "directional":
        direction = orbit_direction(light.azimuth, light.polar).to(normals)
        shares[:, 0] = torch.where(normals @ direction > 0, ahead[:, 0], behind[:, 0])
    return shares


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
