"""Fits that lose at most half a minute to an interruption: they go on from checkpoints."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Protocol

from torch import Tensor

from texgs.core import curves
from texgs.core.progress import progress
from texgs.fit import checkpoint
from texgs.fit.loop import CHECKED_EVERY

SAVED_EVERY = 30.0  # seconds between checkpoints


class Resumable(checkpoint.Stateful, Protocol):
    """A fit that can stop and go on."""

    seconds: float  # that earlier runs have taken
    unit: str  # what an iteration is of, for the progress bar
    losses: list[float]  # every CHECKED_EVERY iterations and at the end

    @property
    def iterations(self) -> int:
        """Of the whole fit."""
        ...

    def run(self) -> Iterator[object]:
        """Iterate to the end."""
        ...

    def restore(self, state: Mapping[str, Tensor]) -> None:
        """Go on from what `state` returned."""
        ...

    def psnr(self) -> float | None:
        """Return the PSNR in dB of training images as they are now, where it is known."""
        ...


def run_to_end(fit: Resumable, folder: Path, title: str) -> float:
    """Run a fit from the last checkpoint in a folder, if there is one.

    Whoever has written the result removes the checkpoint, see `checkpoint.discard`.

    Args:
        fit: at its start.
        folder: of checkpoints.
        title: of the progress bar.

    Returns:
        The seconds of all runs together.

    Raises:
        FitError: if the loss or a parameter is no longer finite.
        ArgumentError: if the checkpoint cannot be read, or none be written.
    """
    restore(fit, folder)
    saved = time.monotonic()
    start = saved - fit.seconds
    steps = fit.iterations - fit.iteration
    run = fit.run()  # to its end even where no steps are left: something may follow the last one
    n_told = _tell(fit, 0)
    for _ in progress(run, steps, title=title, unit=fit.unit) if steps else run:
        n_told = _tell(fit, n_told)
        if time.monotonic() - saved > SAVED_EVERY:
            fit.seconds = time.monotonic() - start
            checkpoint.save(folder, fit)
            saved = time.monotonic()
    return time.monotonic() - start


def restore(fit: Resumable, folder: Path) -> None:
    """Go on from the last checkpoint, if there is one; only the fit's own copy of it stays in memory."""
    if (state := checkpoint.latest(folder)) is not None:
        fit.restore(state)


def _tell(fit: Resumable, n_told: int) -> int:
    """Tell who hears the losses from one on, with the PSNR of now at the last; returns how many there are."""
    count = len(fit.losses)
    if count > n_told and curves.is_heard():
        for index, loss in enumerate(fit.losses[n_told:], n_told + 1):
            curves.point({"loss": loss}, min(index * CHECKED_EVERY, fit.iterations))
        if (psnr := fit.psnr()) is not None:
            curves.point({"train_view_psnr": psnr}, fit.iteration)
    return count
