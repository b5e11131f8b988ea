"""Files of basic models of surfels, at every stage of their fit."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.errors import ArgumentError, errors_at
from texgs.core.io import reading_as
from texgs.core.names import is_number
from texgs.core.tensor_file import read_tensor_file, require_json, write_tensor_file
from texgs.fields.splats import GEOMETRY
from texgs.fields.surfels.model import SHAPES, TEXTURE_TENSORS, Surfels
from texgs.fields.surfels.shading import ShadingModel
from texgs.raster import Texture
from texgs.raster.arguments import check_texture
from texgs.raster.shading import MATERIAL

FORMAT = "texgs-model"
VERSION = 1
SHADED_TENSORS = (*GEOMETRY, "colors", *MATERIAL)
STAGE_TENSORS = {
    "surfels": (*GEOMETRY, "sh"),
    "shading": SHADED_TENSORS,
    "texture": (*SHADED_TENSORS, *TEXTURE_TENSORS),
}  # by stage
DTYPES = {"sizes": torch.int32, "offsets": torch.int64}  # all other tensors are float32


def write_model(path: str | Path, model: Surfels) -> Path:
    """Create or replace a model file in one step; the same model gives the same bytes.

    A safetensors file with the raw tensors under their names. Its header has one entry, "texgs-model": JSON
    with `version`, `stage`, `optics` (the shading model) and `metadata`.

    Args:
        path: target, by custom `model.safetensors`.
        model: any stage, on any device. Its metadata must be JSON: tuples come back as lists, keys as text.

    Raises:
        ArgumentError, ShapeError: if the model could not be read back (a tensor is missing, unknown, not
            finite or of another type, textures overlap, metadata is no JSON), or the file cannot be written.
    """
    return write_tensor_file(path, FORMAT, describe(path, model), model.parameters)


def describe(path: str | Path, model: Surfels) -> dict[str, Any]:
    """Return the JSON description of a model for a file at `path`, and check its tensors."""
    with errors_at(path):
        _check(model, model.stage)
    optics, metadata = asdict(model.shading), dict(model.metadata)
    description = {"version": VERSION, "stage": model.stage, "optics": optics, "metadata": metadata}
    require_json(path, description)
    return description


def read_model(path: str | Path) -> Surfels:
    """Read a file of `write_model`, bit for bit, to the CPU. Nothing in it is executed.

    Raises:
        ArgumentError, ShapeError: if the file is missing, no safetensors, cut short, of another program or a
            newer version, or a tensor is missing, unknown, not finite or of another type or shape.
    """
    return model_of(path, *read_tensor_file(Path(path), FORMAT, VERSION))


def model_of(path: str | Path, description: Mapping[str, Any], tensors: Mapping[str, Tensor]) -> Surfels:
    """Make a model from the tensors and the description of a file, see `describe`."""
    with errors_at(path), reading_as("stage, optics and metadata in the header", "write the file again"):
        stage, shading = str(description["stage"]), _optics(description["optics"])
        model = Surfels(tensors, shading, dict(description["metadata"]))
        _check(model, stage)
    return model


def _optics(stored: dict[str, Any]) -> ShadingModel:
    shading = ShadingModel(**stored)
    are_flags = isinstance(shading.local_viewer, bool) and isinstance(shading.facing, bool)
    known = shading.material in ("bounded", "paper") and are_flags
    if not known or not is_number(shading.low_pass) or shading.low_pass <= 0:
        raise ArgumentError(f"optics: expected values of texgs {FORMAT} version {VERSION}, got {stored}")
    return shading


def _check(model: Surfels, stage: str) -> None:
    """Require the tensors of a stage, with finite values, right types and a valid texture layout."""
    given = model.parameters
    if stage not in STAGE_TENSORS:
        raise ArgumentError(f"expected stage {', '.join(STAGE_TENSORS)}, got {stage!r}")
    for name in STAGE_TENSORS[stage]:
        if name not in given:
            raise ArgumentError(f"expected tensor {name} at stage {stage}, got {', '.join(given)}")
    for name, tensor in given.items():
        if name not in SHAPES and name not in MATERIAL:
            raise ArgumentError(f"expected tensors of a texgs model, got {name}; remove it")
        if tensor.dtype != (dtype := DTYPES.get(name, torch.float32)):
            raise ArgumentError(f"{name}: expected {dtype}, got {tensor.dtype}; convert it")
    check.finite(**given)
    if "texels" in given:
        texels, sizes, offsets = (given[name] for name in TEXTURE_TENSORS[1:])
        check_texture(Texture(given["colors"], given["opacities"], texels, sizes, offsets), len(model))
