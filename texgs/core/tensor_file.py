"""Files of tensors that say in their header of which kind they are."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from torch import Tensor

from texgs.core.errors import ArgumentError
from texgs.core.reading import reading


def read_tensor_file(path: Path, kind: str) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """All tensors of a safetensors file by name, and the JSON of its header.

    Args:
        path: of the file.
        kind: a key of its header, such as "texgs-texture".

    Raises:
        ArgumentError: if the file is missing, damaged or of another kind.
    """
    from safetensors import safe_open

    with reading(path, f"a {kind} file"), safe_open(path, framework="pt") as file:
        header = file.metadata() or {}
        if kind not in header:
            raise ArgumentError(f"{path}: expected a {kind} file, got safetensors of another kind")
        tensors = {name: file.get_tensor(name).clone() for name in file.keys()}  # noqa: SIM118
    try:
        description = json.loads(header[kind])
    except (ValueError, RecursionError) as error:
        raise ArgumentError(f"{path}: expected JSON in the header, got something else") from error
    return tensors, description if isinstance(description, dict) else {}
