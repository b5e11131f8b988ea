"""3D Gaussians with spherical harmonics (Kerbl et al. 2023, 3DGS): what several methods of editing build on.

Lighting is baked into their colours, so that edits can change their opacity but not their light or palette.
"""

from texgs.fields.kinds import Functions, Kind


def functions() -> Functions:
    """Import what reads (ours, or PLY of 3DGS), writes and joins Gaussians."""
    from texgs.fields.gaussians.files import read_gaussians, write_gaussians
    from texgs.fields.gaussians.model import JoinedGaussians

    return Functions(read_gaussians, write_gaussians, JoinedGaussians)


FIELD = Kind(
    "gaussians",
    ("texgs-gaussians", "ply scale_2"),
    frozenset({"opacity"}),
    functions,
    exports=("3dgs", "mesh", "usd", "gltf", "spz"),
    depth="depth",  # the mean, as the authors of 2DGS take it of 3D Gaussians
)
