"""Checkpoints of a fit: one safetensors file, from which a run goes on as if it had never stopped."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Protocol

from torch import Tensor

from texgs.core.errors import ArgumentError
from texgs.core.reading import reading
from texgs.core.tensors import write_tensors
from texgs.fit.loop import require_finite

NAME = "checkpoint.safetensors"
FOLDER = "checkpoint"  # beside the result, there until it is written


class Stateful(Protocol):
    """A fit whose state is a number of iterations and tensors."""

    iteration: int  # done

    def state(self) -> dict[str, Tensor]:
        """Everything a resumed run needs, as tensors, between two steps."""
        ...


def save(folder: str | Path, fit: Stateful) -> Path:
    """Write the state of a fit; the checkpoint before it stays until this one is complete.

    Args:
        folder: of the run, created where missing; it holds one checkpoint.
        fit: between two steps.

    Returns:
        Path of the file.

    Raises:
        FitError: if a value is NaN or infinite; the last good checkpoint stays.
        ArgumentError: if the folder cannot be written to, or the disk is full.
    """
    state = {name: x.contiguous() for name, x in fit.state().items()}
    require_finite(fit.iteration, state)
    return write_tensors(Path(folder) / NAME, state)


def latest(folder: str | Path) -> dict[str, Tensor] | None:
    """The state that `save` wrote last, on the CPU, for `restore`; None where there is none.

    Raises:
        ArgumentError: if the file cannot be read or is no checkpoint.
    """
    from safetensors.torch import load_file

    path = Path(folder) / NAME
    if not path.exists():
        return None
    with reading(path, "a checkpoint", "remove it to start from the beginning"):
        state: dict[str, Tensor] = load_file(path)
    if "iteration" not in state:
        raise ArgumentError(f"{path}: expected a checkpoint, found no iteration in it; remove it")
    return state


def discard(folder: str | Path) -> None:
    """Remove the checkpoint of a run that has ended well; no error where there is none."""
    shutil.rmtree(folder, ignore_errors=True)
