"""The number format that a machine computes pretrained networks in fastest."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import torch

CPUINFO = Path("/proc/cpuinfo")
BFLOAT16_FLAGS = {"avx512_bf16", "amx_bf16", "bf16"}  # what Linux calls instructions for it, x86 and Arm


def fast_dtype(device: torch.device | str) -> torch.dtype:
    """float16 on a GPU, bfloat16 on a CPU with instructions for it, else float32."""
    if torch.device(device).type == "cuda":
        return torch.float16
    return torch.bfloat16 if has_bfloat16() else torch.float32


@cache
def has_bfloat16() -> bool:
    """Whether the processor multiplies bfloat16 itself; where nothing tells, no."""
    if not CPUINFO.exists():
        return False
    lines = CPUINFO.read_text(encoding="utf-8", errors="replace").splitlines()
    flags = next((line for line in lines if line.lower().startswith(("flags", "features"))), "")
    return bool(BFLOAT16_FLAGS & set(flags.split()))
