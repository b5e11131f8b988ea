"""Tensors in a file in the format of safetensors, written in one step and without a copy of them in memory.

The library writes either to bytes, which for the checkpoint of a grid is most of a fit's memory, or to a file
that it opens itself, of which nobody can say when it is whole.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import BinaryIO

import torch
from torch import Tensor

from texgs.core.io import write_atomic

DTYPES = {
    torch.float64: "F64",
    torch.int64: "I64",
    torch.float32: "F32",
    torch.int32: "I32",
    torch.float16: "F16",
    torch.int16: "I16",
    torch.uint8: "U8",
    torch.bool: "BOOL",
}
ALIGNED = 8  # bytes


def write_tensors(
    path: str | Path, tensors: Mapping[str, Tensor], metadata: Mapping[str, str] | None = None
) -> Path:
    """Create or replace a safetensors file in one step; the same tensors give the same bytes.

    Args:
        path: target.
        tensors: on any device, of a type in `DTYPES`.
        metadata: of the header.

    Raises:
        ArgumentError: if the file cannot be written, or the disk is full.
    """
    # Large elements first, so that all lie at multiples of their size, as readers want it.
    ordered = sorted(tensors.items(), key=lambda item: (-item[1].element_size(), item[0]))
    header: dict[str, object] = {"__metadata__": dict(metadata)} if metadata else {}
    end = 0
    for name, x in ordered:
        start, end = end, end + x.numel() * x.element_size()
        header[name] = {"dtype": DTYPES[x.dtype], "shape": list(x.shape), "data_offsets": [start, end]}
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % ALIGNED)

    def write(file: BinaryIO) -> None:
        file.write(len(text).to_bytes(8, "little") + text)
        for _, x in ordered:
            file.write(x.detach().cpu().contiguous().numpy().reshape(-1).data)

    return write_atomic(path, write)
