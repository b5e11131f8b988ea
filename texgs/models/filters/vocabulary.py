"""The words that procedural filters understand."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial

from torch import Tensor

from texgs.core.errors import ArgumentError
from texgs.models.filters import ink, material, paint
from texgs.models.filters.surface import Surface
from texgs.models.guidance import require_instruction

Filter = Callable[[Surface], Tensor]

FILTERS: dict[str, tuple[Filter, tuple[str, ...]]] = {  # by name: the filter and the words for it
    "stipple drawing": (ink.stipple, ("stipple", "stippled", "stippling", "dots", "pointillism")),
    "pencil hatching": (
        ink.hatching,
        ("hatching", "hatched", "crosshatching", "crosshatched", "cross hatching", "cross hatched", "pencil"),
    ),
    "woodcut": (ink.woodcut, ("woodcut", "wood cut", "linocut", "engraving", "engraved")),
    "watercolour": (paint.watercolour, ("watercolour", "watercolor", "water", "aquarelle")),
    "oil painting": (paint.oil, ("oil", "oils", "brush strokes", "brushstrokes")),
    "cartoon": (paint.cartoon, ("cartoon", "comic", "cel shading", "cel shaded", "toon")),
    "marble": (material.marble, ("marble", "stone")),
    "wood": (material.wood, ("wood", "wooden")),
    "mosaic": (material.mosaic, ("mosaic", "tiles", "tiled")),
    "gold": (partial(material.metal, tones=material.GOLD), ("gold", "golden")),
    "silver": (partial(material.metal, tones=material.SILVER), ("silver", "chrome", "steel")),
    "copper": (partial(material.metal, tones=material.COPPER), ("copper", "bronze")),
}
# Words that say nothing about the look.
FILLERS = """
    a an and appear as by change color coloured colored colour convert draw drawing drawn effect give have in
    into it like look made make making object of out paint painted painting picture please render rendered
    scene sculpture sketch style styled surface texture textured that the them this to transform turn volume
    was were with
"""


def vocabulary() -> list[str]:
    """What can be asked for, one entry each."""
    return [*FILTERS, "any named colour, such as 'make it dark red' or '#8040ff'"]


def understand(instruction: str) -> tuple[str, Filter]:
    """Name and filter of an instruction: one entry of the vocabulary, in any of the usual wordings.

    Raises:
        ArgumentError: if it is empty, or says anything that is not in the vocabulary, which is listed.
    """
    text = require_instruction(instruction)
    words = [word for word in re.findall(r"[#\w]+", text.lower()) if word not in FILLERS.split()]
    asked = " ".join(words)
    for name, (function, synonyms) in FILTERS.items():
        if any(asked in (word, f"{word} pencil", f"pencil {word}") for word in synonyms):
            return name, function
    color = named_color("".join(words))
    if color is not None:
        return f"colour {asked}", partial(material.tint, color=color)
    raise ArgumentError(
        f"instruction: expected one of {', '.join(vocabulary())}; got {text!r}, which needs the guidance "
        "instruct-pix2pix"
    )


def named_color(name: str) -> tuple[float, float, float] | None:
    """Red, green and blue of a colour by its CSS name or as #rrggbb; None if there is no such colour."""
    from matplotlib.colors import CSS4_COLORS, is_color_like, to_rgb

    if name in CSS4_COLORS or (name.startswith("#") and is_color_like(name)):
        red, green, blue = to_rgb(name)
        return red, green, blue
    return None
