"""Instructions of users, and the vocabulary of the procedural filters."""

import re

from texgs.core.colors import Color, channels
from texgs.core.errors import ArgumentError

WORDS = {  # for a filter, by its name
    "stipple drawing": ("stipple", "stippled", "stippling", "dots", "pointillism"),
    "pencil hatching": (
        *("hatching", "hatched", "crosshatching", "crosshatched", "cross hatching", "cross hatched"),
        "pencil",
    ),
    "woodcut": ("woodcut", "wood cut", "linocut", "engraving", "engraved"),
    "watercolour": ("watercolour", "watercolor", "water", "aquarelle"),
    "oil painting": ("oil", "oils", "brush strokes", "brushstrokes"),
    "cartoon": ("cartoon", "comic", "cel shading", "cel shaded", "toon"),
    "marble": ("marble", "stone"),
    "wood": ("wood", "wooden"),
    "glass": ("glass",),
    "mosaic": ("mosaic", "tiles", "tiled"),
    "gold": ("gold", "golden"),
    "silver": ("silver", "chrome", "steel"),
    "copper": ("copper", "bronze"),
}
# Words that say nothing about the look.
FILLERS = """
    a an and appear as by change color coloured colored colour convert draw drawing drawn effect give have in
    into it like look made make making object of out paint painted painting picture please render rendered
    scene sculpture sketch style styled surface texture textured that the them this to transform turn volume
    was were with
"""


def require_instruction(instruction: str) -> str:
    """Strip an instruction, and require that it is not empty."""
    if not isinstance(instruction, str) or not instruction.strip():
        raise ArgumentError(
            f"instruction: expected what to do in words, such as 'make it gold', got {instruction!r}"
        )
    return instruction.strip()


def vocabulary() -> list[str]:
    """Return the entries of the vocabulary."""
    return [*WORDS, "any named colour, such as 'make it dark red' or '#8040ff'"]


def understand(instruction: str) -> tuple[str, Color | None]:
    """Return the name of the filter or colour that an instruction asks for, in the usual wordings."""
    text = require_instruction(instruction)
    words = [word for word in re.findall(r"[#\w]+", text.lower()) if word not in FILLERS.split()]
    asked = " ".join(words)
    for name, synonyms in WORDS.items():
        if any(asked in (word, f"{word} pencil", f"pencil {word}") for word in synonyms):
            return name, None
    if found := channels("".join(words)):
        red, green, blue, *_ = found
        return f"colour {asked}", (red, green, blue)
    raise ArgumentError(
        f"instruction: expected one of {', '.join(vocabulary())}; got {text!r}, which needs "
        "guidance=instruct_pix2pix"
    )
