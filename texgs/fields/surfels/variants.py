"""Variants of a model's texture, such as a style: their files, and segments with their own variant."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.errors import ArgumentError, errors_at
from texgs.core.tensor_file import read_tensor_file, write_tensor_file
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.texels import owners

FORMAT = "texgs-texture"
VERSION = 1
LAYOUT = {"texels": (3, torch.float32), "sizes": (2, torch.int32), "colors": (3, torch.float32)}


def write_texture(path: str | Path, model: Surfels, metadata: Mapping[str, Any] | None = None) -> Path:
    """Write texels, in the order of their surfels, and colours of a model, in one step.

    The sizes of the textures identify the model.

    Metadata are JSON, such as the name of the style.
    """
    if model.stage != "texture":
        raise ArgumentError(f"{path}: expected a model of stage texture, got {model.stage}")
    description = {"version": VERSION, "metadata": dict(metadata or {})}
    p = model.parameters
    tensors = {"texels": p["texels"][owners(p)[0]], "colors": p["colors"], "sizes": p["sizes"]}
    return write_tensor_file(path, FORMAT, description, tensors)


def with_texture(model: Surfels, path: str | Path) -> Surfels:
    """Return the model with the texels of a file, and its colours if it has any."""
    _, texture = read_tensor_file(Path(path), FORMAT, VERSION)
    p = model.parameters
    with errors_at(path):
        _require_texels(texture)
        if model.stage != "texture" or not torch.equal(texture["sizes"], p["sizes"].cpu()):
            raise ArgumentError(
                f"expected a texture of this model, got one of {len(texture['sizes'])} surfels and "
                f"{len(texture['texels'])} texels; make it again from the model"
            )
        check.finite(texels=texture["texels"], colors=texture.get("colors"))
        if "colors" in texture:
            check.shape("colors", texture["colors"], "N 3", N=len(model))
    changed = {name: x.to(p[name].device) for name, x in texture.items() if name in ("texels", "colors")}
    changed["texels"] = p["texels"].index_copy(0, owners(p)[0], changed["texels"])
    return replace(model, parameters={**p, **changed})


def _require_texels(texture: Mapping[str, Tensor]) -> None:
    """Require texels and sizes that match, of the right types; colours are optional."""
    given = {name: (*x.shape[1:], x.dtype) for name, x in texture.items()}
    are_known = {"colors": (3, torch.float32), **given} == LAYOUT
    if not are_known or len(texture["texels"]) != int(texture["sizes"].long().prod(1).sum()):
        raise ArgumentError("expected texels and sizes that fit each other; make it again")


def labels_of(masks: Sequence[Tensor], n: int) -> Tensor:
    """Return the number of each surfel's segment [N], int64, counted from 1; 0 outside all segments.

    A surfel that several masks hold belongs to the first: later segments get what earlier ones left.
    """
    labels = torch.zeros(n, dtype=torch.int64, device=masks[0].device)
    for number, mask in reversed(list(enumerate(masks, start=1))):
        check.shape("segment", mask, "N", N=n)
        if mask.dtype != torch.bool:
            raise ArgumentError(f"segment: expected a mask of type bool, got {mask.dtype}; compare it first")
        labels[mask] = number
    return labels


def with_variants(model: Surfels, labels: Tensor, variants: Sequence[Surfels]) -> Surfels:
    """Return the model with the texture of each segment taken from its own variant of the model.

    What no segment holds stays as it is. The model itself is returned where nothing changes. `variants` are
    of each segment the model with other texels and colours, laid out alike.
    """
    p = model.parameters
    places, surfel = owners(p)
    of_texel = torch.zeros(len(p["texels"]), dtype=labels.dtype, device=labels.device)
    of_texel[places] = labels[surfel]
    joined: dict[str, Tensor] = {}
    for name, segment in (("texels", of_texel), ("colors", labels)):
        changed = [number for number, own in enumerate(variants, 1) if own.parameters[name] is not p[name]]
        for number in changed:
            mine = segment == number
            joined.setdefault(name, p[name].clone())[mine] = variants[number - 1].parameters[name][mine]
    return replace(model, parameters={**p, **joined}) if joined else model
