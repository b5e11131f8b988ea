"""Textures as the paper's release stores them beside its surfels."""

from __future__ import annotations

import pickle
import zipfile
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from texgs.core import check
from texgs.core.errors import ArgumentError
from texgs.raster import Texture
from texgs.raster.atlas import check_texture

# What torch.load and taking its result apart raise for a file of another kind.
UNREADABLE = (
    *(OSError, RuntimeError, pickle.UnpicklingError, EOFError),
    *(AttributeError, LookupError, TypeError, ValueError),
)


def read_texture(folder: Path, n: int) -> dict[str, Tensor]:
    """Read `texture.npz` and `palette_colors_chkpnt.pth` of one basic scene without executing anything.

    The release clamps palette + texel before it interpolates; so are the texels here. It has texel i of U at
    i / U of the texture's side, we at (i + 0.5) / U: the picture on each surfel moves by half a texel.

    Args:
        folder: of the release's `point_cloud.ply`.
        n: number of surfels.

    Returns:
        palette [3], texels [T, 3], sizes [N, 2] and offsets [N] of a model, surfel after surfel.

    Raises:
        ArgumentError, ShapeError: if a file is missing, of another kind, or does not fit the surfels.
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
    try:
        with np.load(path, allow_pickle=False) as arrays:
            texels, dims = arrays["texture_dc"], arrays["texture_dims"]
    except FileNotFoundError as error:
        raise ArgumentError(f"{path}: no such file; the release writes it beside the surfels") from error
    except (OSError, KeyError, TypeError, ValueError, EOFError, zipfile.BadZipFile) as error:
        raise ArgumentError(f"{path}: expected texture_dc and texture_dims as npz, got {error}") from error
    return torch.from_numpy(texels.astype(np.float32)), torch.from_numpy(dims.astype(np.int64))


def _palette(path: Path) -> Tensor:
    """[3], clamped as the release does when it reads it."""
    try:
        captured, _ = torch.load(path, map_location="cpu", weights_only=True)
        palette = captured[0].detach().float()
    except FileNotFoundError as error:
        raise ArgumentError(f"{path}: no such file; the release writes it beside the surfels") from error
    except UNREADABLE as error:
        raise ArgumentError(
            f"{path}: expected a palette as the release saves it, a list of one tensor and a number, "
            "got another kind of file"
        ) from error
    check.shape("palette", palette, "3")
    return palette.clamp(0, 1)
