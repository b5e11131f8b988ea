"""Files of steps of a series: how the surfels of one step differ from those of the key model."""

from collections.abc import Mapping
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import torch
from torch import Tensor
from torch.nn.functional import normalize

from texgs.core import check
from texgs.core.errors import ArgumentError, located
from texgs.core.tensor_file import read_tensor_file, write_tensor_file
from texgs.fields.surfels.model import Surfels

FORMAT = "texgs-step"
VERSION = 1
# What differences are whole numbers of, for all that changes in a series. A pixel of a view of 800 x 800 is
# about 2^-9 world units wide; scales are logarithms, opacities logits.
UNITS = {"means": 2**-14, "quats": 2**-13, "scales": 2**-10, "opacities": 2**-10, "colors": 2**-13}
UNITS |= {"normals": 2**-13}  # of models that have them
TURNS = ("quats", "normals")
MOST_UNITS = 2**15 - 1  # units of a difference


def write_step(path: str | Path, key: Surfels, model: Surfels, metadata: Mapping[str, Any]) -> Path:
    """Write the surfels of a step, which are those of the key model elsewhere, in one step.

    A safetensors file with whole numbers [N, ...] int16, by the names of `UNITS`; the differences, rounded.
    Quaternions are of length 1 there. Metadata are JSON, such as where the step is from.
    """
    tensors = {
        name: (x / UNITS[name]).round().clamp(-MOST_UNITS, MOST_UNITS).to(torch.int16)
        for name, x in differences(key, model).items()
    }
    description = {"version": VERSION, "key": known_by(key), "metadata": dict(metadata)}
    return write_tensor_file(path, FORMAT, description, tensors)


def differences(key: Surfels, model: Surfels) -> dict[str, Tensor]:
    """Return by how much a model differs from the key model, by the names of `UNITS`.

    Quaternions have length 1, and the sign that is nearer.
    """
    own, other = _comparable(key), _comparable(model)
    check.shape("means", other["means"], "N 3", N=len(key))
    check.finite(**other)
    for name in (name for name in TURNS if name in own):
        flip = (own[name] * other[name]).sum(dim=1, keepdim=True) < 0
        other[name] = torch.where(flip, -other[name], other[name])  # the same rotation
    return {name: other[name] - own[name] for name in own}


def at_step(key: Surfels, path: str | Path) -> Surfels:
    """Return the key model with its surfels where they are in the step of a file.

    Raises:
        ArgumentError, ShapeError: if the file is missing, damaged or of another model.
    """
    description, steps = read_tensor_file(Path(path), FORMAT, VERSION)
    own = _comparable(key)
    with located(path):
        if description.get("key") != known_by(key):
            raise ArgumentError("expected a step of this model, got one of another; make the series again")
        for name, x in own.items():
            if name not in steps or steps[name].shape != x.shape or steps[name].dtype != torch.int16:
                found = ", ".join(f"{each} {list(steps[each].shape)}" for each in steps) or "nothing"
                raise ArgumentError(
                    f"expected a step of this model of {len(key)} surfels, got {found}; make the series again"
                )
    moved = {name: own[name] + UNITS[name] * steps[name].to(own[name]) for name in own}
    return replace(key, parameters={**key.parameters, **moved})


def known_by(key: Surfels) -> str:
    """Return what tells a key model from others: a checksum of its means, exact in files of all formats."""
    return sha256(key.parameters["means"].cpu().contiguous().numpy().tobytes()).hexdigest()[:16]


def _comparable(model: Surfels) -> dict[str, Tensor]:
    """Return what changes in a series, with quaternions of length 1."""
    if "colors" not in model.parameters:
        raise ArgumentError(f"model: expected stage shading or texture, got {model.stage}; fit it further")
    own = {name: model.parameters[name] for name in UNITS if name in model.parameters}
    return {name: normalize(x, dim=1) if name in TURNS else x for name, x in own.items()}
