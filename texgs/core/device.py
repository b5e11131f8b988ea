"""The device that a user asks for."""

from __future__ import annotations

import torch

from texgs.core.errors import DeviceError


def torch_device(name: str) -> torch.device:
    """Return a device of torch by its name.

    Raises:
        DeviceError: if it is a GPU and torch sees none.
    """
    if name == "cuda" and not torch.cuda.is_available():
        raise DeviceError("device=cuda: torch sees no GPU; leave it out to work on the CPU, see texgs doctor")
    return torch.device(name)
