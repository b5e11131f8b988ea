"""The kinds of field of texgs. All but surfels have baked light; edits change only their opacity."""

from texgs.core.names import EXPORTS
from texgs.fields.kinds import ALL, Kind

FIELD = (
    # 3D Gaussians with spherical harmonics (Kerbl et al. 2023): what several methods of editing build on.
    Kind(
        "gaussians",
        ("texgs-gaussians", "ply scale_2"),
        frozenset({"opacity"}),
        "texgs.fields.gaussians:read_gaussians",
        "texgs.fields.gaussians:write_gaussians",
        "texgs.fields.gaussians:JoinedGaussians",
        exports=("3dgs", "mesh", "textured", "usd", "gltf", "spz"),
        depth="depth",  # the mean, as the authors of 2DGS take it of 3D Gaussians
    ),
    # Small networks whose colours are mixtures of a palette: what StyleRF-VolVis builds on.
    Kind(
        "palette",
        ("texgs-palette",),
        frozenset({"opacity"}),
        "texgs.fields.palette.model:read_palette",
        "texgs.fields.palette.model:write_palette",
        "texgs.fields.palette.model:PaletteScene",
        exports=("mesh", "textured"),
        depth="depth",  # the mean
        film_size=128,
    ),
    # Textured 2D Gaussians: what the paper is about.
    Kind(
        "surfels",
        ("texgs-model", "texgs-compact", "ply scale_1"),
        ALL,
        "texgs.fields.surfels.compact:open_model",
        "texgs.fields.surfels.model_file:write_model",
        "texgs.fields.surfels.composition:Composition",
        exports=tuple(EXPORTS),
        depth="median",
    ),
    # Sparse grids of voxels (Fridovich-Keil et al. 2022): what ARF and Instruct-NeRF2NeRF build on.
    Kind(
        "voxels",
        ("texgs-voxels",),
        frozenset({"opacity"}),
        "texgs.fields.voxels:read_voxels",
        "texgs.fields.voxels:write_voxels",
        "texgs.fields.voxels:VoxelScene",
        exports=("mesh", "textured"),
        depth="depth",  # the mean
    ),
)
