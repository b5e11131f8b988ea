"""Common parts of methods that follow an instruction: its keys, and the editor of views."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from texgs.core.errors import ArgumentError
from texgs.core.keys import key
from texgs.edit.method import MethodKeys
from texgs.models.catalogue import HUB, PINNED_PATTERN, PIPELINES
from texgs.models.weights import locate, pipeline_files

if TYPE_CHECKING:
    import numpy as np
    import torch

    from texgs.models.guidance import Guidance

SHOWN_VIEWS = 6  # edited views to show
EDITORS = f"instruct_pix2pix, {', '.join(PIPELINES)}, {HUB}, a folder of diffusers, an address or filters"
WEB = ("http://", "https://")


@dataclass(frozen=True)
class InstructionKeys(MethodKeys):
    """The instruction, and the editor of the views. The scales are those of TexGS-VolVis."""

    instruction: str = key("", "what to do, such as 'make it gold'")
    guidance: str = key("instruct_pix2pix", f"what edits the views: {EDITORS}, which need no weights")
    steps: int | None = key(None, "of denoising; default, here and below, the diffusion model's own", least=1)
    text_scale: float | None = key(None, "guidance by the instruction", least=0)
    image_scale: float | None = key(None, "guidance by the views", least=0)
    negative: str | None = key(None, "what views should not show; default words for light and shadow")
    epipolar: bool = key(False, "InstructPix2Pix edits views together, along epipolar lines")
    disagreement: float = key(
        0.0, "by which edited views differ at random, as a share of their colours and in world units", least=0
    )

    def opened(self, device: torch.device) -> Guidance:
        """Open the editor of the views."""
        from texgs.models.editors import Endpoint, ImagePipeline
        from texgs.models.filters import ProceduralFilters
        from texgs.models.guidance import Disagreeing
        from texgs.models.instruct_pix2pix import InstructPix2Pix

        editor: Guidance
        name, options = self.guidance, ("steps", "text_scale", "image_scale", "negative")
        given = {each: x for each in options if (x := getattr(self, each)) is not None}
        folder = locate(known) if (known := self.known_editor()) else Path(name)
        if name == "filters":
            editor = ProceduralFilters()
        elif name == "instruct_pix2pix":
            editor = InstructPix2Pix.open(folder, device, epipolar=self.epipolar, **given)
        elif name.startswith(WEB):
            editor = Endpoint(name, given)
        else:
            given = {**(PIPELINES[name].numbers if name in PIPELINES else {}), **given}
            editor = ImagePipeline.open(folder, name, device, **given)
        return Disagreeing(editor, self.disagreement) if self.disagreement else editor

    def check(self) -> None:
        """Require a known guidance, and an instruction that it understands."""
        from texgs.models.instruction import require_instruction, understand

        instruction, name = require_instruction(self.instruction), self.guidance
        if name == "filters":
            understand(instruction)
        elif not (name.startswith(WEB) or self.known_editor() or self.files()):
            raise ArgumentError(f"{self.node}.guidance: expected {EDITORS}, got {name!r}")

    def weights(self) -> dict[str, str]:
        """Return the diffusion model if texgs finds its weights."""
        known = self.known_editor()
        return {known: "guidance=filters"} if known else {}

    def known_editor(self) -> str:
        """Return the name of the editor's weights, or "" if texgs does not find them."""
        if self.guidance == "instruct_pix2pix":
            return "instruct-pix2pix"
        return self.guidance if self.guidance in PIPELINES or PINNED_PATTERN.fullmatch(self.guidance) else ""

    def files(self) -> dict[str, Path]:
        """Return the files of the pipeline if it is in a folder."""
        folder = Path(self.guidance)
        paths = [folder / each for names in pipeline_files(folder) for each in names]
        return {f"guidance.{index}": path for index, path in enumerate(filter(Path.is_file, paths))}

    def followed(self) -> str:
        """Return the instruction."""
        return self.instruction


def write_views(folder: Path, rows: Mapping[str, Sequence[np.ndarray]]) -> dict[str, str]:
    """Write views.png, rows of pictures [H, W, 3] before and after edits; return its description."""
    from texgs.core.figures import write_grid

    titles = [f"view {index + 1}" for index in range(len(next(iter(rows.values()))))]
    write_grid(folder / "views.png", rows, titles)
    return {"views.png": "Views before and after they were edited as the instruction says."}
