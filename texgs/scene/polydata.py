"""Surfels as a mesh of PyVista: a small polygon for each, with its colour, normal and opacity."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import torch

from texgs.core.errors import ArgumentError
from texgs.core.geometry import quats_to_matrices
from texgs.fields.field import Composed
from texgs.fields.splats import geometry
from texgs.fields.surfels.composition import Composition
from texgs.raster.shading import Y00
from texgs.scene.export import joined
from texgs.scene.scene import Scene
from texgs.volume.nrrd_file import open_grid

if TYPE_CHECKING:
    import pyvista

SIDES = 6  # of a polygon
REACH = 1.5  # standard deviations from its middle to its corners


def polydata_of(scene: Scene, composed: Composed) -> pyvista.PolyData:
    """Return the visible surfels of a scene: hexagons of 1.5 standard deviations, without light.

    They lie in the coordinates of the scene's volume, +y up, so that they fit `Volume.to_pyvista`; in world
    units where the scene names none. Cells have `rgba` (uint8, straight alpha), `opacity` and `Normals`;
    colours are those without light, of the palette, offset and mean texel.

    Raises:
        ArgumentError: if the scene has no surfels, or none is visible.
    """
    import pyvista

    if not isinstance(composed, Composition):
        raise ArgumentError("to_pyvista: expected a scene of surfels, got another kind; fit surfels for this")
    model = joined(composed.parts, scene.edits)
    means, quats, scales, opacities = geometry(model.parameters)
    turns = quats_to_matrices(quats)
    angles = torch.arange(SIDES, device=means.device) * (2 * np.pi / SIDES)
    corners = REACH * torch.stack([angles.cos(), angles.sin()], dim=1)
    offsets = torch.einsum("nij,sj,nj->nsi", turns[..., :2], corners, scales)
    points = (means[:, None] + offsets).reshape(-1, 3).cpu().numpy()
    numbers = np.arange(len(points)).reshape(-1, SIDES)
    faces = np.concatenate([np.full((len(numbers), 1), SIDES), numbers], axis=1)
    mesh = pyvista.PolyData(in_volume(points, scene), faces=faces.ravel())
    color = (0.5 + Y00 * model.parameters["sh"][:, 0]).clamp(0, 1)
    rgba = torch.cat([color, opacities.reshape(-1, 1)], dim=1)
    mesh.cell_data["rgba"] = (255 * rgba).round().to(torch.uint8).cpu().numpy()
    mesh.cell_data["opacity"] = opacities.reshape(-1).cpu().numpy()
    mesh.cell_data["Normals"] = turns[..., 2].cpu().numpy()
    mesh.set_active_scalars("rgba", preference="cell")
    return mesh


def in_volume(points: np.ndarray, scene: Scene) -> np.ndarray:
    """Return points [N, 3] of the world in the physical coordinates of a scene's volume, if it has one."""
    if scene.volume is None:
        return points
    grid = open_grid(scene.volume.file)
    middle = np.array(grid.origin) + 0.5 * np.array(grid.sides)
    return np.asarray(points / grid.scale + middle)
