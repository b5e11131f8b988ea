"""Sparse grids of voxels (Plenoxels): what ARF and Instruct-NeRF2NeRF build on."""

from texgs.fields.kinds import Functions, Kind


def functions() -> Functions:
    """Import what reads, writes and merges grids."""
    from texgs.fields.voxels.file import read_voxels, write_voxels
    from texgs.fields.voxels.model import VoxelScene

    return Functions(read_voxels, write_voxels, VoxelScene)


FIELD = Kind(
    "voxels",
    ("texgs-voxels",),
    frozenset({"opacity"}),
    functions,
    exports=("mesh",),
    depth="depth",  # the mean
)
