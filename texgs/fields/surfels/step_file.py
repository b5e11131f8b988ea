"""Files of steps of a series: differences of the surfels of one step from the key model."""

from collections.abc import Mapping
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import torch
from torch import Tensor
from torch.nn.functional import normalize

from texgs.core import check
from texgs.core.errors import ArgumentError, errors_at
from texgs.core.tensor_file import read_tensor_file, write_tensor_file
from texgs.fields.surfels.model import Surfels

FORMAT = "texgs-step"
VERSION = 1
# Units of the integer differences, for all tensors that change in a series. A pixel of an 800 x 800 view is
# about 2^-9 world units wide; scales are logarithms, opacities logits.
UNITS = {"means": 2**-14, "quats": 2**-13, "scales": 2**-10, "opacities": 2**-10, "colors": 2**-13}
UNITS |= {"normals": 2**-13}  # for models with normals
TURNING_TENSORS = ("quats", "normals")
MAX_UNITS = 2**15 - 1  # units of a difference


def write_step(path: str | Path, key: Surfels, model: Surfels, metadata: Mapping[str, Any]) -> Path:
    """Write the surfels of a time step as differences from the key model, atomically.

    A safetensors file with whole numbers [N, ...] int16, by the names of `UNITS`; the differences, rounded.
    Quaternions are of length 1 there. Metadata are JSON, such as where the step is from.
    """
    tensors = {
        name: (x / UNITS[name]).round().clamp(-MAX_UNITS, MAX_UNITS).to(torch.int16)
        for name, x in differences(key, model).items()
    }
    description = {"version": VERSION, "key": key_checksum(key), "metadata": dict(metadata)}
    return write_tensor_file(path, FORMAT, description, tensors)


def differences(key: Surfels, model: Surfels) -> dict[str, Tensor]:
    """Return the differences of a model from the key model, by the names of `UNITS`.

    Quaternions have length 1 and the nearer sign.
    """
    own, other = _comparable(key), _comparable(model)
    check.shape("means", other["means"], "N 3", N=len(key))
    check.finite(**other)
    for name in (name for name in TURNING_TENSORS if name in own):
        flip = (own[name] * other[name]).sum(dim=1, keepdim=True) < 0
        other[name] = torch.where(flip, -other[name], other[name])  # the same rotation
    return {name: other[name] - own[name] for name in own}


def at_step(key: Surfels, path: str | Path) -> Surfels:
    """Return the key model with its surfels at the places of a step file.

    Raises:
        ArgumentError, ShapeError: if the file is missing, damaged or of another model.
    """
    description, steps = read_tensor_file(Path(path), FORMAT, VERSION)
    own = _comparable(key)
    with errors_at(path):
        if description.get("key") != key_checksum(key):
            raise ArgumentError("expected a step of this model, got one of another; make the series again")
        for name, x in own.items():
            if name not in steps or steps[name].shape != x.shape or steps[name].dtype != torch.int16:
                found = ", ".join(f"{each} {list(steps[each].shape)}" for each in steps) or "nothing"
                raise ArgumentError(
                    f"expected a step of this model of {len(key)} surfels, got {found}; make the series again"
                )
    moved = {name: own[name] + UNITS[name] * steps[name].to(own[name]) for name in own}
    return replace(key, parameters={**key.parameters, **moved})


def key_checksum(key: Surfels) -> str:
    """Return a checksum of a key model's means, which all file formats keep exactly."""
    return sha256(key.parameters["means"].cpu().contiguous().numpy().tobytes()).hexdigest()[:16]


def _comparable(model: Surfels) -> dict[str, Tensor]:
    """Return the tensors that change in a series, with unit quaternions."""
    if "colors" not in model.parameters:
        raise ArgumentError(f"model: expected stage shading or texture, got {model.stage}; fit it further")
    own = {name: model.parameters[name] for name in UNITS if name in model.parameters}
    return {name: normalize(x, dim=1) if name in TURNING_TENSORS else x for name, x in own.items()}
