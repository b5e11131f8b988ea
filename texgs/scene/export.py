"""What other programs read of a scene: its visible surfels in one colour each, without light."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from texgs.core.errors import ArgumentError
from texgs.core.io import write_atomic
from texgs.fields.part_edit import MOST_OPAQUE, PartEdit
from texgs.fields.splats import geometry
from texgs.fields.surfels.composition import Part, by_part
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.texels import mean_texels
from texgs.raster.shading import Y00


def joined(parts: Sequence[Part], edits: Sequence[PartEdit]) -> Surfels:
    """Return the visible surfels of a scene as one model of stage surfels, whatever light shone on them.

    Args:
        parts: of a `Composition`.
        edits: one for each, and behind it those of its segments; palette, opacity and visibility count.

    Returns:
        A model with one harmonic, that of the colour without light (palette + offset + mean texel).
    """
    surfels = [_surfels(part, own) for part, own in zip(parts, by_part(parts, edits), strict=True)]
    together = {name: torch.cat([each[name] for each in surfels]) for name in surfels[0]}
    if not len(together["means"]):
        raise ArgumentError("models: expected at least one visible surfel, got none; show a model")
    return Surfels(together, parts[0].model.shading)


def write_points(path: str | Path, model: Surfels, least_opacity: float = 0.5) -> Path:
    """Create or replace a PLY point cloud in one step: means, and colours without light as 8-bit numbers.

    Args:
        path: target.
        model: any stage; before shading, colours are those of the constant harmonic.
        least_opacity: of a surfel that becomes a point.
    """
    from plyfile import PlyData, PlyElement

    if model.stage != "surfels":
        model = joined([Part.of(model)], [PartEdit()])
    means, _, _, opacities = geometry(model.parameters)
    opaque = opacities >= least_opacity
    if not bool(opaque.any()):
        most = float(opacities.max()) if len(opacities) else 0.0
        raise ArgumentError(
            f"{path}: expected surfels with an opacity of {least_opacity:g} at least, got {most:.3g} "
            "at most; lower the limit"
        )
    color = (0.5 + Y00 * model.parameters["sh"][:, 0])[opaque]
    vertices = np.empty(len(color), VERTEX)
    fill(vertices, means[opaque], color.clamp(0, 1).mul(255).round())
    return write_atomic(path, PlyData([PlyElement.describe(vertices, "vertex")], byte_order="<").write)


VERTEX = [*((axis, "<f4") for axis in "xyz"), *((channel, "u1") for channel in ("red", "green", "blue"))]


def fill(vertices: np.ndarray, places: Tensor, colors: Tensor) -> None:
    """Set places [V, 3] and colours [V, 3] from 0 to 255 of vertices."""
    for names, values in ((("x", "y", "z"), places), (("red", "green", "blue"), colors)):
        for name, column in zip(names, values.detach().cpu().numpy().T, strict=True):
            vertices[name] = column


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
