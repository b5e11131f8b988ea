"""Files of segments: a mask of a basic model's surfels, with anchors that identify the model."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.errors import ArgumentError
from texgs.core.tensor_file import read_tensor_file, write_tensor_file
from texgs.fields.surfels.model import Surfels

FORMAT = "texgs-segment"
VERSION = 1
ANCHORS = 64  # surfels whose positions a file stores, spread over the list
TOLERANCE = 1e-3  # in model extents: above the rounding of other formats, below another fit's shifts


def write_segment(
    path: str | Path, model: Surfels, mask: Tensor, metadata: Mapping[str, Any] | None = None
) -> Path:
    """Write a segment in one step: a safetensors file with `mask` [N] and `anchors`, places of some surfels.

    The model may be of any stage; metadata are JSON, such as the clicks that it came from.
    """
    check.shape("mask", mask, "N", N=len(model))
    if mask.dtype != torch.bool or not bool(mask.any()):
        raise ArgumentError(
            f"{path}: expected a mask of type bool that holds a surfel, got {mask.dtype} with "
            f"{int(mask.count_nonzero())}"
        )
    description = {"version": VERSION, "metadata": dict(sorted((metadata or {}).items()))}
    return write_tensor_file(path, FORMAT, description, {"mask": mask, "anchors": _anchors(model)})


def read_segment(path: str | Path, model: Surfels) -> Tensor:
    """Return the mask [N] bool of a segment, on the model's device."""
    _, tensors = read_tensor_file(Path(path), FORMAT, VERSION)
    mask, anchors, expected = tensors.get("mask"), tensors.get("anchors"), _anchors(model)
    is_mask = mask is not None and mask.dtype == torch.bool and mask.ndim == 1
    if mask is None or anchors is None or not is_mask or bool((mask.view(torch.uint8) > 1).any()):
        raise ArgumentError(f"{path}: expected a mask and anchors, got {', '.join(tensors)}; make it again")
    # A model without surfels has no anchors; its segments are empty, which writing refuses.
    extent = float((expected.amax(0) - expected.amin(0)).max()) if len(expected) else 0.0
    belongs = len(mask) == len(model) and anchors.shape == expected.shape
    # This form makes NaN a mismatch.
    if not belongs or not bool(((anchors - expected).abs() <= TOLERANCE * extent).all()):
        raise ArgumentError(
            f"{path}: expected a segment of this model, got one of another with {len(mask)} surfels; "
            "segment this model again"
        )
    return mask.to(model.device)


def _anchors(model: Surfels) -> Tensor:
    """Return the means [A, 3] of surfels spread over the list."""
    means = model.parameters["means"].detach().cpu()
    return means[torch.linspace(0, max(len(means) - 1, 0), min(ANCHORS, len(means))).long()].contiguous()
