"""Files of 3D Gaussians."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.errors import ArgumentError, TexgsError
from texgs.core.tensor_file import read_tensor_file, short, write_tensor_file
from texgs.fields.gaussians.model import Baked, Gaussians

FORMAT = "texgs-gaussians"
VERSION = 1


def write_gaussians(path: str | Path, model: Gaussians) -> Path:
    """Create or replace a model file in one step; the same model gives the same bytes.

    A safetensors file with the raw tensors under their names. Its header has one entry, "texgs-gaussians":
    JSON with `version`, `filter` and `metadata`.

    Args:
        path: target, by custom `model.safetensors`.
        model: on any device. Its metadata must be JSON: tuples come back as lists, keys as text.

    Returns:
        The path.
    """
    _check(path, model)
    description = {
        "version": VERSION,
        "filter": asdict(model.shading),
        "metadata": dict(model.metadata),
    }
    return write_tensor_file(path, FORMAT, description, model.parameters)


def read_gaussians(path: str | Path) -> Gaussians:
    """Read a file of `write_gaussians`, bit for bit, to the CPU; nothing in it is executed."""
    path = Path(path)
    description, tensors = read_tensor_file(path, FORMAT, VERSION)
    model = _model(path, description, tensors)
    _check(path, model)
    return model


def _model(path: Path, description: Mapping[str, Any], tensors: Mapping[str, Tensor]) -> Gaussians:
    try:
        shading = Baked(**description["filter"])
        if not isinstance(shading.antialiased, bool):
            raise ValueError("antialiased is neither true nor false")
        return Gaussians(tensors, shading, dict(description["metadata"]))
    except TexgsError as error:
        raise type(error)(f"{path}: {error}") from error
    except (KeyError, TypeError, ValueError) as error:
        raise ArgumentError(
            f"{path}: expected filter and metadata in the header, got {short(description)}; "
            "write the file again"
        ) from error


def _check(path: str | Path, model: Gaussians) -> None:
    """Require finite float32 values."""
    for name, tensor in model.parameters.items():
        if tensor.dtype != torch.float32:
            raise ArgumentError(f"{path}: {name}: expected torch.float32, got {tensor.dtype}; convert it")
    try:
        check.finite(**model.parameters)
    except TexgsError as error:
        raise type(error)(f"{path}: {error}") from error
