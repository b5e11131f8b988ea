"""Files of palette fields: networks and the grid as safetensors, levels and lattice as JSON in the header."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.errors import ArgumentError, ShapeError, TexgsError
from texgs.core.tensor_file import read_tensor_file, write_tensor_file
from texgs.fields.palette.model import PaletteField
from texgs.fields.palette.networks import network_shapes
from texgs.fields.palette.rendering import Geometry
from texgs.fields.voxels.file import grid_of
from texgs.raster.hash_encoding import HashLevels
from texgs.raster.voxels import March

FORMAT = "texgs-palette"
VERSION = 1
GRID = ("masks", "density")  # its tensors, before networks


def write_palette(path: str | Path, field: PaletteField) -> Path:
    """Create or replace a file of a palette field in one step; the same field gives the same bytes.

    Args:
        path: target.
        field: to write. Its metadata must be JSON.
    """
    geometry = field.geometry
    networks = {name: x.detach().contiguous() for name, x in field.parameters.items()}
    check.finite(**networks)
    description = {
        "version": VERSION,
        "lower": geometry.grid.lower,
        "spacing": geometry.grid.spacing,
        "step": geometry.march.step,
        "transmittance_min": geometry.march.transmittance_min,
        "hash": asdict(geometry.levels),
        "metadata": dict(field.metadata),
    }
    grid = {"masks": geometry.grid.masks, "density": geometry.grid.density}
    return write_tensor_file(path, FORMAT, description, {**grid, **networks})


def read_palette(path: str | Path) -> PaletteField:
    """Read a file of a palette field as `write_palette` writes it, bit for bit. Nothing in it is executed."""
    path = Path(path)
    description, tensors = read_tensor_file(path, FORMAT, VERSION)
    try:
        networks = {name: x for name, x in tensors.items() if name not in GRID}
        check.finite(density=tensors["density"], **networks)
        geometry = _geometry(tensors, description)
        _check_networks(networks, geometry.levels)
        return PaletteField(geometry, networks, dict(description["metadata"]))
    except TexgsError as error:
        raise type(error)(f"{path}: {error}") from error
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ArgumentError(f"{path}: expected networks and a grid, got others; write it again") from error


def _geometry(tensors: Mapping[str, Tensor], description: Mapping[str, Any]) -> Geometry:
    grey = torch.zeros(len(tensors["density"]), 1, 3)
    march = March(step=float(description["step"]), transmittance_min=float(description["transmittance_min"]))
    return Geometry(grid_of({**tensors, "sh": grey}, description), march, HashLevels(**description["hash"]))


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
