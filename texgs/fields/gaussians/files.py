"""Files of 3D Gaussians: our own, and PLY files as 3DGS writes them, for other programs."""

from dataclasses import asdict
from pathlib import Path

import torch
from torch.nn.functional import pad

from texgs.core import check
from texgs.core.errors import ArgumentError, located
from texgs.core.io import reading_as
from texgs.core.ply_file import is_ply, read_vertices
from texgs.core.tensor_file import read_tensor_file, write_tensor_file
from texgs.fields.gaussians.model import Baked, Gaussians
from texgs.fields.ply_columns import Told, splat_columns, take_geometry, take_harmonics, write_columns

FORMAT = "texgs-gaussians"
VERSION = 1
HARMONICS = 16  # of degree 3, which programs for PLY files expect


def write_gaussians(path: str | Path, model: Gaussians) -> Path:
    """Create or replace a model file in one step; the same model gives the same bytes.

    A safetensors file with the raw tensors under their names. Its header has one entry, "texgs-gaussians":
    JSON with `version`, `filter` and `metadata`.
    Metadata must be JSON: tuples come back as lists, keys as text.
    """
    with located(path):
        _require_finite_float32(model)
    shading, metadata = asdict(model.shading), dict(model.metadata)
    description = {"version": VERSION, "filter": shading, "metadata": metadata}
    return write_tensor_file(path, FORMAT, description, model.parameters)


def read_gaussians(path: str | Path) -> Gaussians:
    """Read a file of `write_gaussians`, or a PLY file, to the CPU; nothing in it is executed."""
    path = Path(path)
    if is_ply(path):
        return read_ply(path)
    description, tensors = read_tensor_file(path, FORMAT, VERSION)
    with located(path), reading_as("filter and metadata in the header", "write the file again"):
        shading = Baked(**description["filter"])
        if not isinstance(shading.antialiased, bool):
            raise ValueError("antialiased that is neither true nor false")
        model = Gaussians(tensors, shading, dict(description["metadata"]))
        _require_finite_float32(model)
    return model


def _require_finite_float32(model: Gaussians) -> None:
    for name, tensor in model.parameters.items():
        if tensor.dtype != torch.float32:
            raise ArgumentError(f"{name}: expected torch.float32, got {tensor.dtype}; convert it")
    check.finite(**model.parameters)


def write_ply(path: str | Path, model: Gaussians, told: Told = None) -> Path:
    """Create or replace a binary PLY file in one step, 248 bytes for each Gaussian.

    It holds means, normals of zero, harmonics of degree 3 (those that the model has not are zero), and
    opacities, scales and quaternions raw. Filter and metadata are lost.
    """
    p = {name: x.detach().cpu() for name, x in model.parameters.items()}
    with located(path):
        check.finite(**p)
    sh = pad(p["sh"], (0, 0, 0, HARMONICS - p["sh"].shape[1]))
    return write_columns(path, splat_columns(p, torch.zeros_like(p["means"]), sh), told=told)


def read_ply(path: str | Path) -> Gaussians:
    """Read 3D Gaussians from a PLY file of 3DGS or of a program that writes such files."""
    vertices = read_vertices(path)
    with located(path):
        parameters = {**take_geometry(vertices, 3), "sh": take_harmonics(vertices)}
        check.finite(**parameters)
        return Gaussians(parameters)
