"""Files of tensors that say in their header of which kind they are."""

from __future__ import annotations

from pathlib import Path

from torch import Tensor

from texgs.core.errors import ArgumentError
from texgs.core.reading import reading


def read_tensor_file(path: Path, kind: str) -> dict[str, Tensor]:
    """All tensors of a safetensors file by name.

    Args:
        path: of the file.
        kind: a key of its header, such as "texgs-texture".

    Raises:
        ArgumentError: if the file is missing, damaged or of another kind.
    """
    from safetensors import safe_open

    with reading(path, f"a {kind} file"), safe_open(path, framework="pt") as file:
        if kind not in (file.metadata() or {}):
            raise ArgumentError(f"{path}: expected a {kind} file, got safetensors of another kind")
        return {name: file.get_tensor(name).clone() for name in file.keys()}  # noqa: SIM118
