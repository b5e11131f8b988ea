"""The surfels of a scene as one model, for programs that have neither textures nor our light."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from texgs.core.errors import ArgumentError
from texgs.fields.part_edit import MOST_OPAQUE, PartEdit
from texgs.fields.surfels.composition import Part, by_part
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.texels import mean_texels
from texgs.raster.shading import Y00


def joined(parts: Sequence[Part], edits: Sequence[PartEdit]) -> Surfels:
    """Return the visible surfels of a scene as one model of stage surfels, whatever light shone on them.

    Edits are one for each part, and behind it those of its segments; palette, opacity and visibility count.
    The model has one harmonic, that of the colour without light (palette + offset + mean texel).
    """
    surfels = [_surfels(part, own) for part, own in zip(parts, by_part(parts, edits), strict=True)]
    together = {name: torch.cat([each[name] for each in surfels]) for name in surfels[0]}
    if not len(together["means"]):
        raise ArgumentError("models: expected at least one visible surfel, got none; show a model")
    return Surfels(together, parts[0].model.shading)


def _surfels(part: Part, edits: Sequence[PartEdit]) -> dict[str, Tensor]:
    """Return the raw parameters of a part's visible surfels."""
    p = part.model.parameters
    colors = part.colored(edits).double()
    if "texels" in p:
        colors = colors + mean_texels(p)
    opacities = part.opacity(edits)
    surfels = {
        **{name: p[name] for name in ("means", "quats", "scales")},
        "opacities": opacities.clamp_max(MOST_OPAQUE).logit(),
        "sh": ((colors - 0.5) / Y00).float()[:, None],
    }
    return {name: x[opacities > 0] for name, x in surfels.items()}
