"""Tensors from files of weights, without running anything that such a file may hold."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from torch import Tensor

from texgs.core.errors import ArgumentError
from texgs.core.reading import reading
from texgs.core.torch_file import load_torch


def read_tensors(path: str | Path, names: Iterable[str] | None = None) -> dict[str, Tensor]:
    """Tensors of a file of weights by name, nothing else of it: safetensors, or torch's own format.

    Args:
        path: with the ending .safetensors, or any other for torch's; nothing in it is executed.
        names: of the tensors wanted; by default all. Others are not read.
    """
    from safetensors import safe_open

    with reading(path, "a file of weights", "copy or download it again") as path:
        if path.suffix == ".safetensors":
            with safe_open(path, framework="pt") as file:
                chosen = _chosen(path, file.keys(), names)
                return {name: file.get_tensor(name) for name in chosen}
        stored = load_torch(path)
        return {name: _whole(path, name, stored[name]) for name in _chosen(path, stored, names)}


def _whole(path: Path, name: str, tensor: object) -> Tensor:
    """A tensor of which every number is in the file: few can be told to be read again and again."""
    if not isinstance(tensor, Tensor) or tensor.nbytes > tensor.untyped_storage().nbytes():
        raise ArgumentError(f"{path}: {name}: expected a tensor, got something else; download it again")
    return tensor


def _chosen(path: Path, stored: Iterable[str], names: Iterable[str] | None) -> list[str]:
    there = list(stored)
    wanted = there if names is None else list(names)
    if missing := [name for name in wanted if name not in set(there)]:
        raise ArgumentError(
            f"{path}: expected tensor {missing[0]}, got {', '.join(there[:4])} ...; use weights of this model"
        )
    return wanted
