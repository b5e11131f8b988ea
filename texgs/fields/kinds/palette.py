"""Small networks whose colours are mixtures of a palette: what StyleRF-VolVis builds on."""

from texgs.fields.kinds import Functions, Kind


def functions() -> Functions:
    """Import what reads, writes and composes fields of networks."""
    from texgs.fields.palette.file import read_palette, write_palette
    from texgs.fields.palette.model import PaletteScene

    return Functions(read_palette, write_palette, PaletteScene)


FIELD = Kind(
    "palette",
    ("texgs-palette",),
    frozenset({"opacity"}),
    functions,
    exports=("mesh",),
    depth="depth",  # the mean
    film_size=128,
)
