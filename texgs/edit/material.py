"""Materials that instructions name: highlights, which are edits of the scene as any others."""

from typing import Any, NamedTuple

from torch import Tensor

from texgs.core.errors import ArgumentError
from texgs.fields.part_edit import MOST, PartEdit
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import material
from texgs.models.instruction import understand


class Highlights(NamedTuple):
    """Highlights that a material has."""

    specular: float  # k_s
    shininess: float  # beta
    tint: tuple[float, float, float] = PartEdit.tint


# By the names of the vocabulary. Tints of metals are what these reflect straight on, linear and at most 1
# (Akenine-Moeller et al. 2018, Real-Time Rendering, table 9.2).
MATERIALS = {
    "gold": Highlights(0.9, 20, (1.0, 0.782, 0.344)),
    "silver": Highlights(0.9, 25, (0.972, 0.960, 0.915)),
    "copper": Highlights(0.8, 18, (0.955, 0.638, 0.538)),
    "wood": Highlights(0.1, 8),
    "marble": Highlights(0.3, 30),
    "glass": Highlights(0.9, 60),
}


def highlights_of(instruction: str, model: Surfels, surfels: Tensor | None = None) -> dict[str, Any]:
    """Return the values of a `PartEdit` that give a part the highlights of the material that is named.

    The factors bring the medians of the part's own k_s and beta, as fitted, to those of the material.

    Args:
        instruction: such as "make it gold"; one that says anything else, too, changes nothing: {}.
        model: relightable.
        surfels: [N] bool, those of the part; all by default.
    """
    try:
        named = MATERIALS.get(understand(instruction)[0])
    except ArgumentError:  # what a diffusion model may understand
        named = None
    if named is None:
        return {}
    own = material(model.parameters, model.shading.material)  # [N] or [1]
    edit: dict[str, Any] = {"tint": named.tint}
    for key in ("specular", "shininess"):
        values = own[key] if surfels is None or len(own[key]) == 1 else own[key][surfels]
        wanted, fitted = getattr(named, key), float(values.median())
        if fitted:  # else no factor reaches it
            edit[key] = min(wanted / fitted, MOST)
    return edit
