"""Pretrained networks from files that are never executed, and the fastest number format for them."""

from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from texgs.core.errors import ArgumentError
from texgs.core.io import read_json, reading, reading_as
from texgs.core.tensor_file import load_torch

CPUINFO = Path("/proc/cpuinfo")
BFLOAT16_FLAGS = {"avx512_bf16", "amx_bf16", "bf16"}  # Linux's names of such instructions, x86 and Arm


def fast_dtype(device: torch.device | str) -> torch.dtype:
    """Return float16 on a GPU, bfloat16 on a CPU with instructions for it, otherwise float32."""
    if torch.device(device).type == "cuda":
        return torch.float16
    return torch.bfloat16 if has_bfloat16() else torch.float32


@cache
def has_bfloat16() -> bool:
    """Return whether the processor has bfloat16 instructions; false if unknown."""
    if not CPUINFO.exists():
        return False
    lines = CPUINFO.read_text(encoding="utf-8", errors="replace").splitlines()
    flags = next((line for line in lines if line.lower().startswith(("flags", "features"))), "")
    return bool(BFLOAT16_FLAGS & set(flags.split()))


def read_tensors(path: str | Path, names: Iterable[str] | None = None) -> dict[str, Tensor]:
    """Read all or some tensors of a file by name: .safetensors, or torch's own format."""
    from safetensors import safe_open

    with reading(path, "a file of weights", "copy or download it again") as path:
        if path.suffix == ".safetensors":
            with safe_open(path, framework="pt") as file:
                chosen = _chosen(path, file.keys(), names)
                return {name: file.get_tensor(name) for name in chosen}
        stored = load_torch(path)
        return {name: _whole(path, name, stored[name]) for name in _chosen(path, stored, names)}


def _whole(path: Path, name: str, tensor: object) -> Tensor:
    """Return a tensor stored in full; strides could make a small storage expand without bound."""
    if not isinstance(tensor, Tensor) or tensor.nbytes > tensor.untyped_storage().nbytes():
        raise ArgumentError(f"{path}: {name}: expected a tensor, got something else; download it again")
    return tensor


def _chosen(path: Path, stored: Iterable[str], names: Iterable[str] | None) -> list[str]:
    """Return the wanted names among those in a file."""
    there = list(stored)
    wanted = there if names is None else list(names)
    if missing := [name for name in wanted if name not in set(there)]:
        raise ArgumentError(
            f"{path}: expected tensor {missing[0]}, got {', '.join(there[:4])} ...; use weights of this model"
        )
    return wanted


def read_folder(folder: str | Path, kind: str, names: tuple[str, ...]) -> list[Any]:
    """Read a folder with classes of transformers; networks are frozen and in float32.

    Nothing is downloaded. The kind is the model_type of config.json, such as "clip".
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
