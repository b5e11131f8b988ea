"""Textured 2D Gaussians: what the paper is about. All edits work on them."""

from texgs.fields.kinds import ALL, Functions, Kind


def functions() -> Functions:
    """Import what reads (lossless, compact or PLY), writes (without loss) and joins surfels."""
    from texgs.fields.surfels.compact import open_model
    from texgs.fields.surfels.composition import Composition
    from texgs.fields.surfels.model_file import write_model

    return Functions(open_model, write_model, Composition)


FIELD = Kind(
    "surfels",
    ("texgs-model", "texgs-compact", "ply scale_1"),
    ALL,
    functions,
    exports=("3dgs", "2dgs", "release", "points", "mesh", "compact", "html", "usd", "gltf", "spz", "vtp"),
    depth="median",
)
