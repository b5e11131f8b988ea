"""Exchange of 3D Gaussians with other programs: PLY files as 3DGS writes them."""

from __future__ import annotations

from pathlib import Path

import torch
from torch.nn.functional import pad

from texgs.core import check
from texgs.core.errors import TexgsError
from texgs.core.ply_file import read_vertices
from texgs.fields.gaussians.model import Gaussians
from texgs.fields.ply_columns import splat_columns, take_geometry, take_harmonics, write_columns

HARMONICS = 16  # of degree 3, which programs for these files expect


def write_ply(path: str | Path, model: Gaussians) -> Path:
    """Create or replace a binary PLY file in one step, 248 bytes for each Gaussian.

    It holds means, normals of zero, harmonics of degree 3 (those that the model has not are zero), and
    opacities, scales and quaternions raw. Filter and metadata are lost.

    Raises:
        ArgumentError: if a value is not finite, or the file cannot be written.
    """
    p = {name: x.detach().cpu() for name, x in model.parameters.items()}
    try:
        check.finite(**p)
    except TexgsError as error:
        raise type(error)(f"{path}: {error}") from error
    sh = pad(p["sh"], (0, 0, 0, HARMONICS - p["sh"].shape[1]))
    return write_columns(path, splat_columns(p, torch.zeros_like(p["means"]), sh))


def read_ply(path: str | Path) -> Gaussians:
    """Read 3D Gaussians from a PLY file of 3DGS or of a program that writes such files."""
    vertices = read_vertices(path)
    try:
        parameters = {**take_geometry(vertices, 3), "sh": take_harmonics(vertices)}
        check.finite(**parameters)
        return Gaussians(parameters)
    except TexgsError as error:
        raise type(error)(f"{path}: {error}") from error
