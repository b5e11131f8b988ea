"""A fit that an interruption costs half a minute of: checkpoints while it runs, and where it goes on."""

from __future__ import annotations

import time
from pathlib import Path

from texgs.core.progress import progress
from texgs.fit import checkpoint
from texgs.fit.loop import Fit

SAVED_EVERY = 30.0  # seconds between checkpoints


def run_to_end(fit: Fit, folder: Path, title: str) -> float:
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
    if (state := checkpoint.latest(folder)) is not None:
        fit.restore(state)
    saved = time.monotonic()
    start = saved - fit.seconds
    steps = fit.phase.iterations - fit.iteration
    for _ in progress(fit.run(), steps, title=title, unit="view") if steps else ():
        if time.monotonic() - saved > SAVED_EVERY:
            fit.seconds = time.monotonic() - start
            checkpoint.save(folder, fit)
            saved = time.monotonic()
    return time.monotonic() - start
