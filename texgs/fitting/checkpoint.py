"""Fits that resume from a checkpoint, one safetensors file, as if they had never stopped."""

import shutil
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from pathlib import Path

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.errors import ArgumentError, FitError
from texgs.core.io import reading
from texgs.core.progress import has_curve_logger, log_point, progress
from texgs.core.tensor_file import write_tensors

NAME = "checkpoint.safetensors"
FOLDER = "checkpoint"  # beside the result; removed after it is written
SAVE_INTERVAL = 30.0  # seconds between checkpoints
CHECK_INTERVAL = 100  # iterations between checks of the loss and the parameters


class ResumableFit(ABC):
    """A fit that can stop between two iterations and resume."""

    unit = "step"  # name of an iteration in the progress bar

    def __init__(self, iterations: int) -> None:
        self.iterations = iterations  # of the whole fit
        self.iteration = 0  # done
        self.seconds = 0.0  # of earlier runs; set by the caller that measures them
        self.losses: list[float] = []  # every CHECK_INTERVAL iterations and at the end

    @abstractmethod
    def run(self) -> Iterator[int]:
        """Iterate to the end, and yield the number of iterations done."""

    def psnr(self) -> float | None:
        """Return the current PSNR in dB of training images, or None."""
        return None

    @property
    def is_checked(self) -> bool:
        """Whether the loss of the latest iteration is checked."""
        return self.iteration % CHECK_INTERVAL == 0 or self.iteration == self.iterations

    def note(self, loss: Tensor, tensors: Mapping[str, Tensor]) -> None:
        """Record the loss of the latest iteration, and require finite tensors."""
        require_finite(f"iteration {self.iteration}", tensors)
        self.losses.append(float(loss))

    def state(self) -> dict[str, Tensor]:
        """Return everything a resumed run needs, as tensors."""
        return {
            "iteration": torch.tensor(self.iteration),
            "seconds": torch.tensor(self.seconds).double(),
            "losses": torch.tensor(self.losses).double(),
        }

    def restore(self, state: Mapping[str, Tensor]) -> None:
        """Continue from a result of `state`."""
        self.iteration = int(state["iteration"])
        self.seconds = float(state["seconds"])
        self.losses = state["losses"].tolist()


def require_finite(
    where: object,
    tensors: Mapping[str, Tensor],
    advice: str = "start again with lower rates, the last checkpoint is kept",
) -> None:
    """Stop a fit with NaN. The loss does not show them, because such surfels are skipped."""
    try:
        check.finite(**tensors)
    except ArgumentError as error:
        raise FitError(f"{where}: {error}; {advice}") from error


def run_to_end(fit: ResumableFit, folder: Path, title: str) -> float:
    """Run a fit from the last checkpoint in a folder, if there is one, and return the seconds of all runs.

    An interruption loses half a minute at most. Whoever has written the result removes the checkpoint, see
    `discard`.
    """
    restore(fit, folder)
    saved = time.monotonic()
    start = saved - fit.seconds
    steps = fit.iterations - fit.iteration
    run = fit.run()  # also without steps left: something may follow the last one
    n_told = _tell(fit, 0)
    for _ in progress(run, steps, title=title, unit=fit.unit) if steps else run:
        n_told = _tell(fit, n_told)
        if time.monotonic() - saved > SAVE_INTERVAL:
            fit.seconds = time.monotonic() - start
            save(folder, fit)
            saved = time.monotonic()
    return time.monotonic() - start


def restore(fit: ResumableFit, folder: Path) -> None:
    """Resume from the last checkpoint, if any; only the fit's own copy of it stays in memory."""
    if (state := latest(folder)) is not None:
        fit.restore(state)


def noted_at(count: int, iteration: int, iterations: int) -> list[int]:
    """Return the iterations of the latest `count` losses recorded until an iteration."""
    last = iterations if iteration == iterations else iteration // CHECK_INTERVAL * CHECK_INTERVAL
    number = -(-last // CHECK_INTERVAL)
    return [min((number - back) * CHECK_INTERVAL, last) for back in reversed(range(count))]


def _tell(fit: ResumableFit, n_told: int) -> int:
    """Log losses from an index on, the last one with the current PSNR; return the number of losses."""
    count = len(fit.losses)
    if count > n_told and has_curve_logger():
        places = noted_at(count, fit.iteration, fit.iterations)
        for place, loss in [*zip(places, fit.losses, strict=True)][n_told:]:
            log_point({"loss": loss}, place)
        if (psnr := fit.psnr()) is not None:
            log_point({"train_view_psnr": psnr}, fit.iteration)
    return count


def save(folder: str | Path, fit: ResumableFit) -> Path:
    """Write the state of a fit, and return the file; the previous one stays until this one is complete."""
    state = {name: x.contiguous() for name, x in fit.state().items()}
    require_finite(f"iteration {fit.iteration}", state)
    return write_tensors(Path(folder) / NAME, state)


def latest(folder: str | Path) -> dict[str, Tensor] | None:
    """Read the latest state that `save` wrote, on the CPU, or None."""
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
    """Remove the checkpoint of a finished run, if any."""
    shutil.rmtree(folder, ignore_errors=True)
