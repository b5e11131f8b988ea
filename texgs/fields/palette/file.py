"""Files of palette fields: networks and the grid as safetensors, levels and lattice as JSON in the header."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.errors import ArgumentError, ShapeError, located
from texgs.core.io import reading_as
from texgs.core.tensor_file import read_tensor_file, write_tensor_file
from texgs.fields.palette.model import PaletteField
from texgs.fields.palette.networks import network_shapes
from texgs.fields.palette.rendering import Geometry
from texgs.fields.voxels.file import grid_of, lattice, march_of
from texgs.raster.hash_encoding import HashLevels

FORMAT = "texgs-palette"
VERSION = 1
GRID = ("masks", "density")  # its tensors, before networks


def write_palette(path: str | Path, field: PaletteField) -> Path:
    """Create or replace a file of a palette field in one step; its metadata must be JSON."""
    geometry = field.geometry
    networks = {name: x.detach().contiguous() for name, x in field.parameters.items()}
    check.finite(**networks)
    description = {
        "version": VERSION,
        **lattice(geometry.grid, geometry.march),
        "hash": asdict(geometry.levels),
        "metadata": dict(field.metadata),
    }
    grid = {"masks": geometry.grid.masks, "density": geometry.grid.density}
    return write_tensor_file(path, FORMAT, description, {**grid, **networks})


def read_palette(path: str | Path) -> PaletteField:
    """Read a file of a palette field as `write_palette` writes it, bit for bit. Nothing in it is executed."""
    description, tensors = read_tensor_file(Path(path), FORMAT, VERSION)
    with located(path), reading_as("networks and a grid", "write it again"):
        networks = {name: x for name, x in tensors.items() if name not in GRID}
        check.finite(density=tensors["density"], **networks)
        geometry = _geometry(tensors, description)
        _check_networks(networks, geometry.levels)
        return PaletteField(geometry, networks, dict(description["metadata"]))


def _geometry(tensors: Mapping[str, Tensor], description: Mapping[str, Any]) -> Geometry:
    grey = torch.zeros(len(tensors["density"]), 1, 3)
    grid = grid_of({**tensors, "sh": grey}, description)
    return Geometry(grid, march_of(description), HashLevels(**description["hash"]))


def _check_networks(networks: Mapping[str, Tensor], levels: HashLevels) -> None:
    """Require all networks, those of free colours perhaps, in the right shapes."""
    colors = check.shape("palette.colors", networks["palette.colors"], "P 3")["P"]
    absent = {"base"} if any(name.startswith("free.") for name in networks) else {"base", "free"}
    shapes = {
        name: shape
        for name, shape in network_shapes(levels, colors).items()
        if name.split(".")[0] not in absent
    }
    if unknown := sorted(set(networks) ^ set(shapes)):
        raise ArgumentError(f"{unknown[0]}: expected the networks of a palette field, got others")
    for name, shape in shapes.items():
        check.floating(name, networks[name])
        if tuple(networks[name].shape) != shape:
            raise ShapeError(f"{name}: expected {list(shape)}, got {list(networks[name].shape)}")
