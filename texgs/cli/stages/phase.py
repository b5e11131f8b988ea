"""What the stages of the fit share: views, the loop with checkpoints, evaluation, numbers."""

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from texgs.config.fit import Densify, Losses, Phase, Rates
from texgs.core.progress import progress
from texgs.fields.field import Field
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import ShadingModel
from texgs.fit import checkpoint
from texgs.fit.loop import Fit
from texgs.metrics.quality import evaluate, mean
from texgs.volume.images import Images
from texgs.volume.view_set import ViewSet

SAVED_EVERY = 30.0  # seconds between checkpoints
CHECKPOINT = "checkpoint"  # folder, there until the stage has ended


def phase_from(values: Mapping[str, Any]) -> Phase:
    """A phase from the plain values of its settings."""
    parts = {"rates": Rates, "losses": Losses, "densify": Densify}
    return Phase(**{**values, **{name: kind(**values[name]) for name, kind in parts.items()}})


def gpu_memory(device: torch.device) -> float | None:
    """Peak memory of the GPU in this process, MiB; None on a CPU."""
    return torch.cuda.max_memory_allocated(device) / 2**20 if device.type == "cuda" else None


def run_phase(
    parameters: Mapping[str, Tensor],
    shading: ShadingModel,
    images: Images,
    phase: Phase,
    seed: int,
    output: Path,
    title: str,
) -> tuple[Surfels, float, list[float]]:
    """Run the loop from the last checkpoint in the folder, if there is one.

    Returns:
        The model, the seconds of all runs together, and the losses that they looked at.
    """
    fit = Fit(parameters, shading, images, phase, seed)
    folder = output / CHECKPOINT
    if (state := checkpoint.latest(folder)) is not None:
        fit.restore(state)
    saved = time.monotonic()
    start = saved - fit.seconds
    steps = phase.iterations - fit.iteration
    for _ in progress(fit.run(), steps, title=title, unit="view") if steps else ():
        if time.monotonic() - saved > SAVED_EVERY:
            fit.seconds = time.monotonic() - start
            checkpoint.save(folder, fit)
            saved = time.monotonic()
    seconds = time.monotonic() - start
    return (
        Surfels({name: x.detach() for name, x in fit.parameters.items()}, shading),
        seconds,
        fit.losses,
    )


def quality(model: Field, views: ViewSet, reduce: int, title: str) -> dict[str, Any]:
    """PSNR and SSIM on the test views; none where there are none."""
    return mean(evaluate(model, views.test, reduce, f"{title}: test views")) if views.test else {}


def training_quality(model: Field, views: ViewSet, reduce: int, title: str) -> dict[str, Any]:
    """The same on the views that the model was fitted to."""
    found = mean(evaluate(model, views.train, reduce, f"{title}: training views"))
    return {f"train_{name}": value for name, value in found.items()}
