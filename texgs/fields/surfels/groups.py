"""The parameters of surfels in groups, and how large these are."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from torch import Tensor

from texgs.core.memory import MIB
from texgs.raster.shading import MATERIAL

GEOMETRY = ("means", "quats", "scales", "opacities")
TEXTURE = ("palette", "texels", "sizes", "offsets")
# What the paper counts, and what we store; every tensor of a model is in one group.
COUNTED = {"geometry": GEOMETRY, "shading": MATERIAL, "texture": ("texels",)}
RELEASED = 100  # bytes of a surfel in the files of the authors' release, beside its texels
STORED = {"geometry": GEOMETRY, "shading": ("sh", "colors", *MATERIAL), "texture": TEXTURE}


def sizes(parameters: Mapping[str, Tensor]) -> dict[str, float]:
    """Sizes of the parameters of surfels in MiB, of its geometry, shading, texture and in total.

    `geometry_mib`, `shading_mib`, `texture_mib` and `total_mib` count what the paper's breakdown counts: 10
    floats of geometry per surfel, 4 of material (or 4 in all where surfels share one) and 3 per texel.
    `stored_geometry_mib` and so on count the bytes of all tensors: colours and harmonics as shading, palette
    and layout as texture. A model file is as large as `stored_total_mib` and a header of about a kilobyte.
    `files_mib` are the files of the authors' release: 20 floats and 5 numbers of the layout for a surfel.
    """
    counted, stored = _mebibytes(parameters, COUNTED), _mebibytes(parameters, STORED)
    files = RELEASED * len(parameters["means"]) / MIB + counted["texture_mib"]
    return counted | {"files_mib": files} | {f"stored_{name}": value for name, value in stored.items()}


def _mebibytes(parameters: Mapping[str, Tensor], groups: Mapping[str, Collection[str]]) -> dict[str, float]:
    sizes = {
        f"{group}_mib": sum(x.nbytes for name, x in parameters.items() if name in names) / MIB
        for group, names in groups.items()
    }
    return sizes | {"total_mib": sum(sizes.values())}
