"""Exchange of surfels with other programs: PLY files of 2DGS, of 3DGS and of the paper's release."""

import math
import zipfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from texgs.core import check
from texgs.core.errors import ArgumentError, errors_at
from texgs.core.geometry import quats_to_matrices
from texgs.core.io import reading
from texgs.core.memory import require_memory
from texgs.core.ply_file import read_vertices
from texgs.core.tensor_file import load_torch
from texgs.fields.ply_columns import (
    Told,
    numbered_columns,
    splat_columns,
    take,
    take_geometry,
    take_harmonics,
    write_columns,
)
from texgs.fields.surfels.material import RANGES
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import ShadingModel, material
from texgs.fields.surfels.texels import mean_texels, offsets_of
from texgs.raster import Texture
from texgs.raster.arguments import check_texture
from texgs.raster.shading import Y00

FLAVOURS = ("2dgs", "3dgs", "release")
FLAT_SCALE = float(np.float32(math.log(1e-6)))  # third scale of a surfel for viewers of 3D Gaussians
RELEASE = {  # our names of factors by the release's, in the order of its files
    "diffuse_factor": "diffuse",
    "shininess": "shininess",
    "ambient_factor": "ambient",
    "specular_factor": "specular",
}
(_, MOST_SPECULAR), (_, MOST_SHININESS) = RANGES["paper"].values()  # as in the release
BESIDE = "the release writes it beside the surfels"


def write_ply(path: str | Path, model: Surfels, flavour: str = "2dgs", told: Told = None) -> Path:
    """Create or replace a binary PLY file in one step.

    All flavours hold means, unit normals that light sees (2DGS leaves them at zero), opacities, scales and
    quaternions raw, as the model does, and colours as harmonics, `f_rest` one channel after the other. With
    shading the only harmonic is that of the colour without light, (c_ind - 0.5) / Y00. Textures are lost:
    what is left of palette, offset and texture is their mean over each surfel. Low-pass filter and metadata
    are lost too.

    - "2dgs": `scale_0` and `scale_1`; without material.
    - "3dgs": also `scale_2` = log(1e-6), for viewers of 3D Gaussians.
    - "release": as the paper's release stores relightable surfels, so only with shading: 45 `f_rest`, and
      `diffuse_factor`, `shininess`, `ambient_factor`, `specular_factor` under its activations. It clamps the
      coloured and the white part of its shading one by one, so that it may render less light.
    """
    if flavour not in FLAVOURS:
        raise ArgumentError(f"flavour: expected {', '.join(FLAVOURS)}, got {flavour!r}")
    if flavour == "release" and model.stage == "surfels":
        raise ArgumentError(f"{path}: release needs a model with shading, got stage surfels; use 2dgs")
    parameters = {name: x.detach().cpu() for name, x in model.parameters.items()}
    with errors_at(path):
        check.finite(**parameters)
        columns = _columns(Surfels(parameters, model.shading), flavour)
    return write_columns(path, columns, told=told)


def read_ply(path: str | Path) -> Surfels:
    """Read surfels from a PLY file of 2DGS, of the paper's release, or of 3DGS with flat Gaussians.

    Files are told apart by their properties. Those of the release become models of stage shading with
    material "paper" and colours of at least 0, as it clamps them, or of stage texture where textures lie
    beside them; all others, of stage surfels. The low-pass filter is that of 2DGS, as no file says;
    `dataclasses.replace` gives a model another.
    """
    path = Path(path)
    vertices = read_vertices(path)
    with errors_at(path):
        parameters = _geometry(vertices)
        if "ambient_factor" not in (vertices.dtype.names or ()):
            parameters["sh"] = take_harmonics(vertices)
            shading = ShadingModel(low_pass=2.0)
        else:
            parameters |= _appearance(vertices, path.parent)
            shading = ShadingModel(low_pass=2.0, material="paper", facing=False)
        check.finite(**parameters)
        return Surfels(parameters, shading)


# -- writing ---


def _columns(model: Surfels, flavour: str) -> dict[str, Tensor]:
    """Return [N] values by property, in the order of the flavour."""
    p = model.parameters
    normals = quats_to_matrices(p.get("normals", p["quats"]))[..., 2]  # [N, 3]
    sh = p["sh"] if model.stage == "surfels" else ((_color(p) - 0.5) / Y00)[:, None]  # [N, K, 3]
    if flavour == "release":
        place = dict(zip("xyz", p["means"].T, strict=True))
        dark = numbered_columns("f_rest", sh.new_zeros(len(model), 45))  # the release's loader expects them
        shape = numbered_columns("scale", p["scales"]) | numbered_columns("rot", p["quats"])
        common = {"opacity": p["opacities"]} | numbered_columns("normal", normals) | shape
        return place | numbered_columns("f_dc", sh[:, 0]) | dark | common | _release_material(model)
    if flavour == "3dgs":
        third = torch.full_like(p["opacities"], FLAT_SCALE)[:, None]
        p = {**p, "scales": torch.cat([p["scales"], third], dim=1)}
    return splat_columns(p, normals, sh)


def _color(p: Mapping[str, Tensor]) -> Tensor:
    """Return c_ind of each surfel [N, 3] in float64, so that harmonics are rounded only once."""
    if "texels" not in p:
        return p["colors"].double()
    return p["colors"].double() + p["palette"].double() + mean_texels(p)


def _release_material(model: Surfels) -> dict[str, Tensor]:
    """Return raw material under the release's names and activations, [N] each."""
    raw = {name: model.parameters[name] for name in RELEASE.values()}
    if model.shading.material != "paper":
        raw = material({name: x.double() for name, x in raw.items()}, model.shading.material)
        if bool((raw["shininess"] >= MOST_SHININESS).any()):
            raise ArgumentError(
                f"shininess: expected less than {MOST_SHININESS:g}, as the release can express, got up to "
                f"{float(raw['shininess'].max()):.4g}; use flavour 2dgs, or lower it"
            )
        raw["specular"] = torch.logit(raw["specular"] / MOST_SPECULAR)
        raw["shininess"] = torch.logit(raw["shininess"] / MOST_SHININESS)
    return {theirs: raw[ours].expand(len(model)) for theirs, ours in RELEASE.items()}


# -- reading ---


def _geometry(vertices: np.ndarray) -> dict[str, Tensor]:
    """Read raw geometry, also of flat Gaussians."""
    geometry = take_geometry(vertices, 2)
    names = vertices.dtype.names or ()
    if "scale_2" in names and "ambient_factor" not in names:  # the release writes a meaningless one
        third = take(vertices, "scale_2")[:, 0]
        thick = (third > FLAT_SCALE) & (third > geometry["scales"].amax(1) - math.log(10))
        if bool(thick.any()):
            raise ArgumentError(
                f"expected flat Gaussians, got {int(thick.sum())} of {len(thick)} with a third axis above a "
                "tenth of the longest; fit surfels instead"
            )
    return geometry


def _appearance(vertices: np.ndarray, folder: Path) -> dict[str, Tensor]:
    """Read colour and material of the release's surfels, and textures if the file has no colour."""
    factors = take(vertices, *RELEASE)
    parameters = {ours: factors[:, k].contiguous() for k, ours in enumerate(RELEASE.values())}
    if "mappings_0" in (vertices.dtype.names or ()):
        return parameters | {"colors": torch.zeros(len(vertices), 3)} | _textures(folder, len(vertices))
    dc = take(vertices, "f_dc_0", "f_dc_1", "f_dc_2")
    return parameters | {"colors": (0.5 + Y00 * dc.double()).clamp(min=0).float()}


# -- textures of the release ---


def _textures(folder: Path, n: int) -> dict[str, Tensor]:
    """Read `texture.npz` and `palette_colors_chkpnt.pth` of one basic scene without executing anything.

    The release clamps palette + texel before it interpolates; so are the texels here. It has texel i of U at
    i / U of the texture's side, we at (i + 0.5) / U: the picture on each surfel moves by half a texel.
    """
    texels, dims = _arrays(folder / "texture.npz")
    check.shape("texture_dims", dims, "N 3", N=n)
    palette = _palette(folder / "palette_colors_chkpnt.pth")
    sizes, starts = dims[:, :2].int(), dims[:, 2].long()
    check_texture(Texture(texels, texels, texels, sizes, starts), n)
    texels = (texels + palette).clamp(0, 1) - palette
    offsets = offsets_of(sizes)
    texels = texels[_transposed(sizes.long(), starts, offsets)]
    return {"palette": palette, "texels": texels, "sizes": sizes, "offsets": offsets}


def _transposed(sizes: Tensor, starts: Tensor, offsets: Tensor) -> Tensor:
    """Return the release's index of each of our texels [T]; its neighbours lie along v, ours along u."""
    surfel = torch.repeat_interleave(sizes.prod(1))  # [T]
    k = torch.arange(len(surfel)) - offsets[surfel]
    n_u, n_v = sizes[surfel].unbind(1)
    return starts[surfel] + (k % n_u) * n_v + k // n_u


def _arrays(path: Path) -> tuple[Tensor, Tensor]:
    """Read texels [T, 3] float32, and for each surfel the counts along u and v and the first texel [N, 3]."""
    with reading(path, "texture_dc and texture_dims as npz", BESIDE):
        with zipfile.ZipFile(path) as archive:
            n_bytes = sum(entry.file_size for entry in archive.infolist())
            require_memory(2 * n_bytes, f"{path}: arrays of {n_bytes} bytes", BESIDE)
        with np.load(path, allow_pickle=False) as arrays:
            texels, dims = arrays["texture_dc"], arrays["texture_dims"]
        return torch.from_numpy(texels.astype(np.float32)), torch.from_numpy(dims.astype(np.int64))


def _palette(path: Path) -> Tensor:
    """Read the palette colour [3], clamped as by the release."""
    with reading(path, "a palette as the release saves it, a list of one tensor and a number", BESIDE):
        captured, _ = load_torch(path)
        palette = captured[0].detach()
        check.shape("palette", palette, "3")
        return palette.float().clamp(0, 1)
