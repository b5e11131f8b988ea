"""The surfels of a scene as text in a page: what compact model files have, packed by zlib, in base64."""

from __future__ import annotations

import json
import zlib
from base64 import b64encode
from dataclasses import asdict
from pathlib import Path

import numpy as np
from torch import Tensor

from texgs.core.errors import ArgumentError
from texgs.fields.surfels.compact import STEP, compact_tensors
from texgs.fields.surfels.composition import Composition

MOST_STEPS = 2**15 - 1  # of a texel, on a graphics card


def pack(path: Path, composition: Composition) -> str:
    """The tensors of all models, named NUMBER.PARAMETER, and `labels` [N] of surfels that segments have.

    The same scene gives the same text. Browsers unpack zlib by themselves, but not xz.

    Args:
        path: of the page, for messages.
        composition: of the scene.
    """
    from safetensors.numpy import save

    tensors: dict[str, np.ndarray] = {}
    for number, part in enumerate(composition.parts):
        model = part.model.to("cpu")
        if "texels" in model.parameters:
            require_range(path, model.parameters["texels"])
        own = compact_tensors(path, model)
        if part.labels is not None:
            own["labels"] = part.labels.cpu().numpy().astype(np.uint8 if part.segments < 256 else np.int32)
        tensors |= {f"{number}.{name}": values for name, values in own.items()}
    optics = [asdict(part.model.shading) for part in composition.parts]
    facts = {"models": optics, "low_pass": composition.options.low_pass, "step": STEP}
    # One entry: safetensors writes several in any order.
    return b64encode(zlib.compress(save(tensors, {"optics": json.dumps(facts)}), 9)).decode()


def require_range(path: Path, texels: Tensor) -> None:
    """Require texels [T, 3] that 16 bits hold."""
    largest = float(texels.abs().max()) if len(texels) else 0.0
    if largest > MOST_STEPS * STEP:
        raise ArgumentError(
            f"{path}: texels: expected at most {MOST_STEPS * STEP:g}, got {largest:g}; fit the texture again"
        )
