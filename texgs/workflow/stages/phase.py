"""What the phases of all fits share: rule, loop, evaluation, numbers."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texgs.core.memory import MIB
from texgs.fitting.settings import Phase
from texgs.fitting.task import FitTask
from texgs.report.results import FitResult
from texgs.workflow.stage import Outcome, Rule
from texgs.workflow.stages.settings import OfTF, Recipe

if TYPE_CHECKING:
    from torch import Tensor

    from texgs.fields.field import Field
    from texgs.fields.surfels.model import Surfels
    from texgs.fields.surfels.shading import ShadingModel
    from texgs.fitting.attributes import Attributes

PHASE = Rule(
    "phase", "{dataset}/{tf}/{fit}/{phase}", ("model.safetensors",), target="fits", gpu=("fit",), swept=True
)


@dataclass(kw_only=True)
class PhaseSettings(OfTF):
    """What all phases read of the configuration."""

    fit: Recipe


class FitJob(FitTask[Recipe]):
    """One phase of the fit of a basic TF, by its recipe: what it starts with, and how its result is told."""

    @classmethod
    def of(cls, settings: PhaseSettings, inputs: Mapping[str, Path], output: Path) -> FitJob:
        """Return the job with the views that it reads."""
        from texgs.core.check import torch_device
        from texgs.volume.images import load
        from texgs.volume.nrrd_file import open_grid
        from texgs.volume.view_set import read_views

        fit, views = settings.fit, read_views(inputs["views"].parent)
        title = f"{settings.dataset}/{settings.tf}: {settings.stage}"
        metadata = {"dataset": settings.dataset, "tf": settings.tf}
        images = load(views.train, fit.reduce)
        volume = open_grid(inputs["volume"]) if "volume" in inputs else None
        return cls(fit, views, images, output, torch_device(fit.device), fit.seed, title, metadata, volume)

    def run(
        self,
        parameters: Mapping[str, Tensor],
        shading: ShadingModel,
        phase: Phase,
        held: Attributes | None = None,
    ) -> tuple[Surfels, float, list[float]]:
        """Run the loop of surfels from the last checkpoint in the folder, if there is one.

        Returns:
            The model, the seconds of all runs together, and the losses that they looked at. Surfels lie along
            a Z curve: what a tile of a view shows is then mostly together in memory, texels above all.
        """
        from texgs.core.geometry import z_order_of
        from texgs.fields.surfels.model import Surfels
        from texgs.fitting.checkpoint import FOLDER, run_to_end
        from texgs.fitting.densify import is_shared
        from texgs.fitting.loop import Fit

        fit = Fit(parameters, shading, self.images, phase, self.seed, held)
        seconds = run_to_end(fit, self.output / FOLDER, self.title)
        fitted = fit.result
        order = z_order_of(fitted["means"])
        ordered = {name: x if is_shared(name, x) else x[order] for name, x in fitted.items()}
        return Surfels(ordered, shading), seconds, fit.losses

    def outcome(
        self,
        field: Field,
        seconds: float,
        iterations: int = 0,
        losses: Sequence[float] = (),
        measured: Sequence[str] = ("test",),
        **more: Any,
    ) -> Outcome:
        """Return the result, with the quality on views of some splits; the checkpoint goes.

        After the last phase, when training views are measured too, parts that are missing are told on stderr.
        """
        import torch

        from texgs.fitting import checkpoint
        from texgs.metrics.quality import what_is_lost
        from texgs.volume.images import smaller

        camera = smaller(self.views.train[0].camera, self.settings.reduce)
        scores: dict[str, Any] = {}
        for split in measured:
            scores |= self.quality(field, split)
        if "train" in measured and (lost := what_is_lost(scores.get("shown"))):
            print(f"{self.title}: {lost}", file=sys.stderr)
        is_gpu = self.device.type == "cuda"
        memory = torch.cuda.max_memory_allocated(self.device) / MIB if is_gpu else None
        checkpoint.discard(self.output / checkpoint.FOLDER)
        seen = {"train_views": len(self.views.train), "width": camera.width, "height": camera.height}
        told = {**(seen if measured else {}), **scores, "peak_gpu_memory_mib": memory, **more}
        return Outcome(FitResult(seconds, len(field), iterations, list(losses), **told))

    def quality(self, field: Field, split: str) -> dict[str, float]:
        """Return PSNR and SSIM on views of a split, where there are some, as the result names them."""
        from texgs.metrics.quality import evaluate, mean

        if not (views := getattr(self.views, split)):
            return {}
        scores = mean(evaluate(field, views, self.settings.reduce, f"{self.title}: {split} views"))
        return scores if split == "test" else {f"{split}_{name}": scores[name] for name in ("psnr", "ssim")}
