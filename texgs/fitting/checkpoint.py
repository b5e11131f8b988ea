"""Fits that go on from a checkpoint, one safetensors file, as if they had never stopped."""

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
FOLDER = "checkpoint"  # beside the result, there until it is written
SAVED_EVERY = 30.0  # seconds between checkpoints
CHECKED_EVERY = 100  # iterations between looks at the loss and the parameters


class ResumableFit(ABC):
    """A fit that can stop between two iterations and go on."""

    unit = "step"  # what an iteration is, for the progress bar

    def __init__(self, iterations: int) -> None:
        self.iterations = iterations  # of the whole fit
        self.iteration = 0  # done
        self.seconds = 0.0  # that earlier runs have taken, kept by whoever times them
        self.losses: list[float] = []  # every CHECKED_EVERY iterations and at the end

    @abstractmethod
    def run(self) -> Iterator[int]:
        """Iterate to the end, and yield how many iterations are done."""

    def psnr(self) -> float | None:
        """Return the PSNR in dB of training images as they are now, where it is known."""
        return None

    @property
    def is_checked(self) -> bool:
        """Whether the loss of the iteration that is done is looked at."""
        return self.iteration % CHECKED_EVERY == 0 or self.iteration == self.iterations

    def note(self, loss: Tensor, tensors: Mapping[str, Tensor]) -> None:
        """Note the loss of the iteration that is done, and require finite tensors."""
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
        """Go on from what `state` returned."""
        self.iteration = int(state["iteration"])
        self.seconds = float(state["seconds"])
        self.losses = state["losses"].tolist()


def require_finite(
    where: object,
    tensors: Mapping[str, Tensor],
    advice: str = "start again with lower rates, the last checkpoint is kept",
) -> None:
    """Stop a fit that has gone wrong; its loss alone does not tell: surfels with NaN are skipped."""
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
    run = fit.run()  # to its end even where no steps are left: something may follow the last one
    n_told = _tell(fit, 0)
    for _ in progress(run, steps, title=title, unit=fit.unit) if steps else run:
        n_told = _tell(fit, n_told)
        if time.monotonic() - saved > SAVED_EVERY:
            fit.seconds = time.monotonic() - start
            save(folder, fit)
            saved = time.monotonic()
    return time.monotonic() - start


def restore(fit: ResumableFit, folder: Path) -> None:
    """Go on from the last checkpoint, if there is one; only the fit's own copy of it stays in memory."""
    if (state := latest(folder)) is not None:
        fit.restore(state)


def noted_at(count: int, iteration: int, iterations: int) -> list[int]:
    """Return the iterations of so many losses, the latest ones that a fit has noted until an iteration."""
    last = iterations if iteration == iterations else iteration // CHECKED_EVERY * CHECKED_EVERY
    number = -(-last // CHECKED_EVERY)
    return [min((number - back) * CHECKED_EVERY, last) for back in reversed(range(count))]


def _tell(fit: ResumableFit, n_told: int) -> int:
    """Tell who hears the losses from one on, with the PSNR of now at the last; return how many there are."""
    count = len(fit.losses)
    if count > n_told and has_curve_logger():
        places = noted_at(count, fit.iteration, fit.iterations)
        for place, loss in [*zip(places, fit.losses, strict=True)][n_told:]:
            log_point({"loss": loss}, place)
        if (psnr := fit.psnr()) is not None:
            log_point({"train_view_psnr": psnr}, fit.iteration)
    return count


def save(folder: str | Path, fit: ResumableFit) -> Path:
    """Write the state of a fit, and return the file; the one before stays until this one is complete."""
    state = {name: x.contiguous() for name, x in fit.state().items()}
    require_finite(f"iteration {fit.iteration}", state)
    return write_tensors(Path(folder) / NAME, state)


def latest(folder: str | Path) -> dict[str, Tensor] | None:
    """Read the state that `save` wrote last, on the CPU, for `restore`; None where there is none."""
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
