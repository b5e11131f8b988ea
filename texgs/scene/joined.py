"""The surfels of a scene as one model, for programs without textures and our lights, and as a mesh."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from texgs.core.errors import ArgumentError
from texgs.core.geometry import quats_to_matrices
from texgs.core.io import write_bytes
from texgs.fields.part_edit import MAX_OPACITY, PartEdit
from texgs.fields.ply_columns import Told
from texgs.fields.splats import geometry
from texgs.fields.surfels.composition import EditableModel, by_part
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.texels import mean_texels
from texgs.raster.shading import Y00
from texgs.volume.space import Space

if TYPE_CHECKING:
    import pyvista
SIDES = 6  # of the polygon for a surfel
REACH = 1.5  # standard deviations from its middle to its corners


def join_surfels(parts: Sequence[EditableModel], edits: Sequence[PartEdit]) -> Surfels:
    """Join the visible surfels of a scene into one unlit model of stage surfels.

    Edits are one for each part, and behind it those of its segments; palette, opacity and visibility count.
    The model has one harmonic, that of the colour without light (palette + offset + mean texel).
    """
    has_normals = any("normals" in part.model.parameters for part in parts)
    by_model = zip(parts, by_part(parts, edits), strict=True)
    surfels = [_surfels(part, own, has_normals) for part, own in by_model]
    together = {name: torch.cat([each[name] for each in surfels]) for name in surfels[0]}
    if not len(together["means"]):
        raise ArgumentError("models: expected at least one visible surfel, got none; show a model")
    return Surfels(together, parts[0].model.shading)


def _surfels(part: EditableModel, edits: Sequence[PartEdit], has_normals: bool) -> dict[str, Tensor]:
    """Return the raw parameters of a part's visible surfels, on request with separate normals."""
    p = part.model.parameters
    colors = part.colored(edits).double()
    if "texels" in p:
        colors = colors + mean_texels(p)
    opacities = part.opacity(edits)
    surfels = {
        **{name: p[name] for name in ("means", "quats", "scales")},
        **({"normals": p.get("normals", p["quats"])} if has_normals else {}),
        "opacities": opacities.clamp_max(MAX_OPACITY).logit(),
        "sh": ((colors - 0.5) / Y00).float()[:, None],
    }
    return {name: x[opacities > 0] for name, x in surfels.items()}


def polydata_of(model: Surfels, space: Space | None = None) -> pyvista.PolyData:
    """Return surfels, see `join_surfels`, as hexagons of 1.5 standard deviations.

    They lie in a file's space, or in the world where there is none. Cells have `rgba`
    (uint8, straight alpha), `opacity` and `Normals`, those that light sees; colours are those without light,
    of the palette, offset and mean texel.
    """
    import pyvista

    means, quats, scales, opacities = geometry(model.parameters)
    turns = quats_to_matrices(quats)
    angles = torch.arange(SIDES, device=means.device) * (2 * np.pi / SIDES)
    corners = REACH * torch.stack([angles.cos(), angles.sin()], dim=1)
    offsets = torch.einsum("nij,sj,nj->nsi", turns[..., :2], corners, scales)
    points = (means[:, None] + offsets).reshape(-1, 3).cpu().numpy()
    normals = quats_to_matrices(model.parameters.get("normals", quats))[..., 2].cpu().numpy()
    numbers = np.arange(len(points)).reshape(-1, SIDES)
    if space is not None:
        points, normals = space.points(points), (normals @ space.turn.T).astype(np.float32)
        numbers = numbers[:, ::-1] if space.is_mirrored else numbers
    faces = np.concatenate([np.full((len(numbers), 1), SIDES), numbers], axis=1)
    mesh = pyvista.PolyData(points, faces=faces.ravel())
    color = (0.5 + Y00 * model.parameters["sh"][:, 0]).clamp(0, 1)
    rgba = torch.cat([color, opacities.reshape(-1, 1)], dim=1)
    mesh.cell_data["rgba"] = (255 * rgba).round().to(torch.uint8).cpu().numpy()
    mesh.cell_data["opacity"] = opacities.reshape(-1).cpu().numpy()
    mesh.cell_data["Normals"] = normals
    mesh.set_active_scalars("rgba", preference="cell")
    return mesh


def write_vtp(path: str | Path, model: Surfels, space: Space | None = None, told: Told = None) -> Path:
    """Create or replace a .vtp file of `polydata_of` in one step, with facts as field arrays.

    ParaView opens it.
    """
    mesh = polydata_of(model, space)
    for key, value in (told or {}).items():
        mesh.field_data[key] = value if isinstance(value, list) else [value]
    with TemporaryDirectory() as folder:  # VTK writes to a path only
        file = Path(folder, "surfels.vtp")
        mesh.save(file)
        return write_bytes(path, file.read_bytes())
