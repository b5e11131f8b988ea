"""Text-driven editing of textures (the paper's section Text-Driven NPSE): what an instruction says."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from texgs.config.keys import key
from texgs.config.methods import Method

if TYPE_CHECKING:
    import numpy as np
    import torch
    from torch import Tensor

    from texgs.edit.task import EditedScene, Task
    from texgs.fields.surfels.model import Surfels
    from texgs.models.guidance import Guidance
    from texgs.volume.view_set import View

SHOWN = 6  # edited views in the picture of them


@dataclass
class TextKeys:
    """What to do, what edits the views, and how texels follow."""

    instruction: str = key("", "what to do, such as 'make it gold'")
    guidance: str = key(
        "instruct_pix2pix",
        "what edits the views: a diffusion model, or procedural filters with a vocabulary of their own",
        choices=("instruct_pix2pix", "filters"),
    )
    recipe: str = key(
        "default",
        "how texels follow: solved; as in the paper; or iterative: views are edited again and again, as in "
        "Instruct-NeRF2NeRF",
        choices=("default", "paper", "iterative"),
    )
    size: int = key(512, "longer side of the edited views", "pixels", least=64)
    text_scale: float = key(12.5, "guidance by the instruction, of the diffusion model", least=0)
    image_scale: float = key(1.25, "guidance by the views, of the diffusion model", least=0)
    negative: str | None = key(None, "what views should not show; default words for light and shadow")
    epipolar: bool = key(False, "views are edited together, along epipolar lines")
    disagreement: float = key(
        0.0, "by which edited views differ at random, as a share of their colours and in world units", least=0
    )


def run(task: Task[TextKeys]) -> EditedScene:
    """Give the parts the look; write views.png with the views that were edited."""
    from texgs.edit.task import EditedScene
    from texgs.edit.text import edit_by_text
    from texgs.report.strip import write_strip
    from texgs.volume.reduced import smaller

    settings, guidance = task.settings, guidance_of(task.settings, task.device)
    rows: dict[str, list[np.ndarray]] = {}
    seconds: dict[str, float] = {}
    seen: dict[str, float] = {}

    def one(name: str, model: Surfels, surfels: Tensor | None, views: Sequence[View]) -> Surfels:
        start = time.monotonic()
        result = edit_by_text(
            model,
            [smaller(view.camera, task.reduce).to(task.device) for view in views],
            guidance,
            settings.instruction,
            settings.recipe,
            light=views[0].light,
            surfels=surfels,
            size=settings.size,
            seed=task.edit.seed,
        )
        seconds[name], seen[name] = time.monotonic() - start, result.seen
        rows[f"{name} before"] = [image.cpu().numpy() for image in result.views.images[:SHOWN]]
        rows[f"{name} edited"] = [image.cpu().numpy() for image in result.images[:SHOWN]]
        return result.model

    scene = task.each_part(one)
    titles = [f"view {index + 1}" for index in range(len(next(iter(rows.values()))))]
    write_strip(task.output / "views.png", rows, titles)
    return EditedScene(
        scene,
        f"{guidance.name}, {settings.recipe}",
        sum(seconds.values()),
        {"views.png": "Views before and after they were edited as the instruction says."},
        notes={"instruction": settings.instruction, "seconds": seconds, "seen": seen},
    )


def guidance_of(settings: TextKeys, device: torch.device) -> Guidance:
    """What edits the views.

    Raises:
        MissingDataError: if its weights are not on this machine.
    """
    from texgs.models.disagreement import Disagreeing

    guidance = editor_of(settings, device)
    return Disagreeing(guidance, settings.disagreement) if settings.disagreement else guidance


def editor_of(settings: TextKeys, device: torch.device) -> Guidance:
    """The same, whose views agree as well as they can.

    Raises:
        MissingDataError: as `guidance_of`.
    """
    from texgs.models.filters.guidance import ProceduralFilters
    from texgs.models.instruct_pix2pix import NO_LIGHT, InstructPix2Pix
    from texgs.models.weights import locate

    if settings.guidance == "filters":
        return ProceduralFilters()
    return InstructPix2Pix.open(
        locate("instruct-pix2pix"),
        device,
        text_scale=settings.text_scale,
        image_scale=settings.image_scale,
        negative=NO_LIGHT if settings.negative is None else settings.negative,
        epipolar=settings.epipolar,
    )


def check(settings: TextKeys) -> None:
    """Require an instruction that the guidance understands.

    Raises:
        ArgumentError: if there is none.
    """
    from texgs.models.filters.vocabulary import understand
    from texgs.models.instruction import require_instruction

    instruction = require_instruction(settings.instruction)
    if settings.guidance == "filters":
        understand(instruction)


def weights(settings: TextKeys, clip: str) -> Mapping[str, bool]:
    """The diffusion model, where it edits the views."""
    return {"instruct-pix2pix": True} if settings.guidance == "instruct_pix2pix" else {}


METHOD = Method(
    "text",
    "give a scene the look that an instruction asks for",
    TextKeys,
    run,
    check,
    weights,
    needs=frozenset({"texture", "relight"}),
)
