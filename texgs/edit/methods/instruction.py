"""What methods share that follow an instruction: what it says, and what edits views by it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from texgs.core.keys import key
from texgs.edit.method import MethodKeys

if TYPE_CHECKING:
    import numpy as np
    import torch

    from texgs.models.guidance import Guidance

SHOWN = 6  # edited views in the picture of them


@dataclass(frozen=True)
class InstructionKeys(MethodKeys):
    """What to do, and what edits the views. The scales are those of TexGS-VolVis."""

    instruction: str = key("", "what to do, such as 'make it gold'")
    guidance: str = key(
        "instruct_pix2pix",
        "what edits the views: a diffusion model, or procedural filters with a vocabulary of their own",
        choices=("instruct_pix2pix", "filters"),
    )
    text_scale: float = key(12.5, "guidance by the instruction, of the diffusion model", least=0)
    image_scale: float = key(1.25, "guidance by the views, of the diffusion model", least=0)
    negative: str | None = key(None, "what views should not show; default words for light and shadow")
    epipolar: bool = key(False, "views are edited together, along epipolar lines")
    disagreement: float = key(
        0.0, "by which edited views differ at random, as a share of their colours and in world units", least=0
    )

    def opened(self, device: torch.device) -> Guidance:
        """Return what edits the views."""
        from texgs.models.filters import ProceduralFilters
        from texgs.models.guidance import Disagreeing
        from texgs.models.instruct_pix2pix import NO_LIGHT, InstructPix2Pix
        from texgs.models.weights import locate

        editor: Guidance
        if self.guidance == "filters":
            editor = ProceduralFilters()
        else:
            editor = InstructPix2Pix.open(
                locate("instruct-pix2pix"),
                device,
                text_scale=self.text_scale,
                image_scale=self.image_scale,
                negative=NO_LIGHT if self.negative is None else self.negative,
                epipolar=self.epipolar,
            )
        return Disagreeing(editor, self.disagreement) if self.disagreement else editor

    def check(self) -> None:
        """Require an instruction that the guidance understands."""
        from texgs.models.instruction import require_instruction, understand

        instruction = require_instruction(self.instruction)
        if self.guidance == "filters":
            understand(instruction)

    def weights(self) -> dict[str, str]:
        """Return the diffusion model, where it edits the views."""
        return {"instruct-pix2pix": "guidance=filters"} if self.guidance == "instruct_pix2pix" else {}

    def followed(self) -> str:
        """Return the instruction."""
        return self.instruction


def write_views(folder: Path, rows: Mapping[str, Sequence[np.ndarray]]) -> dict[str, str]:
    """Write views.png, a row of pictures [H, W, 3] each before and after edits; return what it shows."""
    from texgs.core.figures import write_grid

    titles = [f"view {index + 1}" for index in range(len(next(iter(rows.values()))))]
    write_grid(folder / "views.png", rows, titles)
    return {"views.png": "Views before and after they were edited as the instruction says."}
