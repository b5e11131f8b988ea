"""Style pictures of texgs, files beside this one: own work, without rights of others.

`python -m tools.style_likeness` describes them for the metric `retrieval`. Most were computed: git has the
program, `tools/style_pictures.py`, at e0f84421.
"""

from __future__ import annotations

from importlib.resources import files
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from texgs.core.errors import ArgumentError

if TYPE_CHECKING:
    from torch import Tensor

PICTURES = (
    *(
        "strokes",
        "glass",
        "marble",
        "weave",
        "dots",
        "waves",
        "hatching",
        "mosaic",
        "bricks",
        "scales",
        "zebra",
    ),
    *("leopard", "planks", "contours", "crackle", "honeycomb", "swirls", "splatter", "knit", "halftone"),
    *("labyrinth", "tartan", "feathers", "facets"),
)
SIZE = 512  # pixels of each side of a file


def picture(name: str, size: int = SIZE) -> Tensor:
    """Read one of `PICTURES`, square and resized: [3, size, size] in [0, 1]."""
    import torch  # slow; a plan of edits needs only the names

    if name not in PICTURES:
        raise ArgumentError(f"picture: expected one of {', '.join(PICTURES)}, got {name!r}")
    with files(__package__).joinpath(f"{name}.webp").open("rb") as file, Image.open(file) as image:
        shown = image if size == SIZE else image.resize((size, size), Image.Resampling.LANCZOS)
        pixels = np.asarray(shown.convert("RGB")) / 255
    return torch.from_numpy(pixels.astype(np.float32)).permute(2, 0, 1).contiguous()
