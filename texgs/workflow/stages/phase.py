"""What the stages of the fit share: their rule, the loop, evaluation, numbers."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texgs.core.memory import MIB
from texgs.fit.settings import Phase
from texgs.workflow.stage import Rule

if TYPE_CHECKING:
    import torch
    from torch import Tensor

    from texgs.fields.field import Field
    from texgs.fields.surfels.model import Surfels
    from texgs.fields.surfels.shading import ShadingModel
    from texgs.volume.images import Images
    from texgs.volume.view_set import ViewSet

PHASE = Rule("phase", "{dataset}/{tf}/{fit}/{phase}", ("model.safetensors",), target="fits", gpu=("fit",))


def gpu_memory(device: torch.device) -> float | None:
    """Return the peak memory of the GPU in this process, MiB; None on a CPU."""
    import torch

    return torch.cuda.max_memory_allocated(device) / MIB if device.type == "cuda" else None


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
        The model, the seconds of all runs together, and the losses that they looked at. Surfels lie along a
        Z curve: what a tile of a view shows is then mostly together in memory, texels above all.
    """
    from texgs.core.geometry import z_order_of
    from texgs.fields.surfels.model import Surfels
    from texgs.fit.checkpoint import FOLDER, run_to_end
    from texgs.fit.densify import is_shared
    from texgs.fit.loop import Fit

    fit = Fit(parameters, shading, images, phase, seed)
    seconds = run_to_end(fit, output / FOLDER, title)
    order = z_order_of(fit.parameters["means"].detach())
    ordered = {
        name: x.detach() if is_shared(name, x) else x.detach()[order] for name, x in fit.parameters.items()
    }
    return Surfels(ordered, shading), seconds, fit.losses


def quality(model: Field, views: ViewSet, reduce: int, title: str) -> dict[str, Any]:
    """Return which views a model is of, and PSNR and SSIM on the test views, where there are some."""
    from texgs.metrics.quality import evaluate, mean
    from texgs.volume.reduced import smaller

    camera = smaller(views.train[0].camera, reduce)
    seen = {"train_views": len(views.train), "width": camera.width, "height": camera.height}
    return seen | (mean(evaluate(model, views.test, reduce, f"{title}: test views")) if views.test else {})


def training_quality(model: Field, views: ViewSet, reduce: int, title: str) -> dict[str, Any]:
    """Return the same on the views that the model was fitted to."""
    from texgs.metrics.quality import evaluate, mean

    measured = mean(evaluate(model, views.train, reduce, f"{title}: training views"))
    return {f"train_{name}": value for name, value in measured.items()}
