"""Models of transformers from folders in its format, with errors that say what is wrong with a folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch

from texgs.core.errors import ArgumentError
from texgs.core.io import read_json
from texgs.core.reading import reading_as


def read_folder(folder: str | Path, kind: str, names: tuple[str, ...]) -> list[Any]:
    """What classes of transformers read from a folder; networks come frozen, in float32 and ready to use.

    Nothing is downloaded.

    Args:
        folder: with config.json, and weights as safetensors.
        kind: the model_type of config.json, such as "clip".
        names: of classes of transformers that can be read from a folder.
    """
    try:
        import transformers
    except ImportError as error:
        raise ArgumentError(
            f"{folder}: expected transformers, which is not installed; pip install '.[models]'"
        ) from error
    folder = Path(folder)
    settings = read_json(folder / "config.json")
    model_type = settings.get("model_type") if isinstance(settings, dict) else None
    if model_type != kind:
        raise ArgumentError(f"{folder}: expected a model of type {kind}, got {model_type}")
    with reading_as(f"a {kind} model of transformers", "copy or download it again", f"{folder}: "):
        read = [getattr(transformers, name).from_pretrained(folder, local_files_only=True) for name in names]
    for part in read:
        if isinstance(part, torch.nn.Module):
            part.float().eval().requires_grad_(False)
    return read
