"""Files of texture variants: other texels and colours for a basic model, such as a style."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.errors import ArgumentError, TexgsError
from texgs.core.tensor_file import read_tensor_file, write_tensor_file
from texgs.fields.surfels.model import Surfels

FORMAT = "texgs-texture"
VERSION = 1


def write_texture(path: str | Path, model: Surfels, metadata: Mapping[str, Any] | None = None) -> Path:
    """Write texels and colours of a model, with the sizes of its textures to know it by, in one step.

    Args:
        path: target.
        model: textured.
        metadata: JSON, such as what the style is.

    Raises:
        ArgumentError: if the model has no texture, metadata is no JSON, or the file cannot be written.
    """
    if model.stage != "texture":
        raise ArgumentError(f"{path}: expected a model of stage texture, got {model.stage}")
    description = {"version": VERSION, "metadata": dict(metadata or {})}
    tensors = {name: model.parameters[name] for name in ("texels", "colors", "sizes")}
    return write_tensor_file(path, FORMAT, description, tensors)


def with_texture(model: Surfels, path: str | Path) -> Surfels:
    """The model with the texels and colours of a variant; a file without colours keeps those of the model.

    Raises:
        ArgumentError: if the file is missing, of another kind, or of another model.
    """
    texture = _read(Path(path))
    p = model.parameters
    if model.stage != "texture" or not torch.equal(texture["sizes"], p["sizes"].cpu()):
        raise ArgumentError(
            f"{path}: expected a texture of this model, got one of {len(texture['sizes'])} surfels "
            f"and {len(texture['texels'])} texels; make it again from the model"
        )
    try:
        check.finite(texels=texture["texels"], colors=texture.get("colors"))
        if "colors" in texture:
            check.shape("colors", texture["colors"], "N 3", N=len(model))
    except TexgsError as error:
        raise ArgumentError(f"{path}: {error}") from error
    changed = {name: x.to(p[name].device) for name, x in texture.items() if name in ("texels", "colors")}
    return replace(model, parameters={**p, **changed})


def _read(path: Path) -> dict[str, Tensor]:
    _, texture = read_tensor_file(path, FORMAT, VERSION)
    shapes = [texture[name].shape[1:] for name in ("texels", "sizes") if name in texture]
    if shapes != [(3,), (2,)] or len(texture["texels"]) != int(texture["sizes"].long().prod(1).sum()):
        raise ArgumentError(f"{path}: expected texels and sizes that fit each other; make it again")
    return texture
