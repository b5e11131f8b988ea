"""Textures as the paper's release stores them beside its surfels."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from texgs.core import check
from texgs.core.io import reading
from texgs.core.memory import require_memory
from texgs.core.tensor_file import load_torch
from texgs.raster import Texture
from texgs.raster.arguments import check_texture

RELEASE = "the release writes it beside the surfels"


def read_texture(folder: Path, n: int) -> dict[str, Tensor]:
    """Read `texture.npz` and `palette_colors_chkpnt.pth` of one basic scene without executing anything.

    The release clamps palette + texel before it interpolates; so are the texels here. It has texel i of U at
    i / U of the texture's side, we at (i + 0.5) / U: the picture on each surfel moves by half a texel.

    Args:
        folder: of the release's `point_cloud.ply`.
        n: number of surfels.

    Returns:
        palette [3], texels [T, 3], sizes [N, 2] and offsets [N] of a model, surfel after surfel.
    """
    texels, dims = _arrays(folder / "texture.npz")
    check.shape("texture_dims", dims, "N 3", N=n)
    palette = _palette(folder / "palette_colors_chkpnt.pth")
    sizes, starts = dims[:, :2].int(), dims[:, 2].long()
    check_texture(Texture(texels, texels, texels, sizes, starts), n)
    texels = (texels + palette).clamp(0, 1) - palette
    counts = sizes.long().prod(1)  # [N]
    offsets = counts.cumsum(0) - counts
    texels = texels[_transposed(sizes.long(), starts, offsets, counts)]
    return {"palette": palette, "texels": texels, "sizes": sizes, "offsets": offsets}


def _transposed(sizes: Tensor, starts: Tensor, offsets: Tensor, counts: Tensor) -> Tensor:
    """Where the release has each of our texels [T]: its neighbours in memory lie along v, ours along u."""
    surfel = torch.repeat_interleave(counts)  # [T]
    k = torch.arange(len(surfel)) - offsets[surfel]
    n_u, n_v = sizes[surfel].unbind(1)
    return starts[surfel] + (k % n_u) * n_v + k // n_u


def _arrays(path: Path) -> tuple[Tensor, Tensor]:
    """Texels [T, 3] float32, and of each surfel texels along u, along v and its first [N, 3]."""
    with reading(path, "texture_dc and texture_dims as npz", RELEASE):
        with zipfile.ZipFile(path) as archive:
            n_bytes = sum(entry.file_size for entry in archive.infolist())
            require_memory(2 * n_bytes, f"{path}: arrays of {n_bytes} bytes", RELEASE)
        with np.load(path, allow_pickle=False) as arrays:
            texels, dims = arrays["texture_dc"], arrays["texture_dims"]
        return torch.from_numpy(texels.astype(np.float32)), torch.from_numpy(dims.astype(np.int64))


def _palette(path: Path) -> Tensor:
    """[3], clamped as the release does when it reads it."""
    with reading(path, "a palette as the release saves it, a list of one tensor and a number", RELEASE):
        captured, _ = load_torch(path)
        palette = captured[0].detach()
        check.shape("palette", palette, "3")
        return palette.float().clamp(0, 1)
