"""How much light reaches the surfels of a scene through its volume."""

import torch
from torch import Tensor

from texgs.core.camera import orbit_direction
from texgs.core.errors import ArgumentError
from texgs.core.light import Light
from texgs.fields.field import Composed, baked_light
from texgs.fields.files import kind_of
from texgs.fields.surfels.composition import Composition
from texgs.scene.scene import Scene
from texgs.scene.twin import Twin
from texgs.volume.light_cells import LightCells

NO_VOLUME = (
    "light: expected the volume of the scene for shadows and occlusion, got none; make the scene again by "
    "texgs compose, or take both back by shadows=0 occlusion=0"
)


def exposure_of(composed: Composed, scene: Scene, twin: Twin | None) -> Tensor | None:
    """Return factors [N, 2] on the lamp's and on ambient light of each primitive, or None without shadows.

    Raises:
        ArgumentError: if there is no volume, or these primitives cannot be relit.
    """
    if not scene.light.casts_shadows:
        return None
    if twin is None:
        raise ArgumentError(NO_VOLUME)
    if not isinstance(composed, Composition):
        return torch.ones(len(composed), 2, device=composed.device)  # is refused
    shares = shares_of(composed, scene.light, twin.light_cells(scene, composed.palettes))
    strengths = shares.new_tensor([scene.light.shadows, scene.light.occlusion])
    return 1 - strengths * (1 - shares)


def require_shadows(scene: Scene) -> None:
    """Require what shadows and occlusion need: models that can be relit, and a volume."""
    kind = kind_of(next(iter(scene.models.values())).file)
    if "relight" not in kind.can:
        raise baked_light(kind.name)
    if scene.volume is None:
        raise ArgumentError(NO_VOLUME)


def shares_of(composed: Composition, light: Light, cells: LightCells) -> Tensor:
    """Return which shares [N, 2] of the light reach the surfels."""
    means, out = composed.means, cells.outset * composed.normals
    ahead, behind = cells.at(means + out), cells.at(means - out)
    if light.kind == "headlight":
        return torch.maximum(ahead, behind)
    direction = orbit_direction(light.azimuth, light.polar).to(means)
    lamp = torch.where(composed.normals @ direction > 0, ahead[:, 0], behind[:, 0])
    return torch.stack([lamp, torch.maximum(ahead[:, 1], behind[:, 1])], dim=1)
