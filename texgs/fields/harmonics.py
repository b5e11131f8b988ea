"""Spherical harmonics as parameters: the zeroth and the others learn at different rates."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor

from texgs.raster.shading import Y00


def zeroth(colors: Tensor) -> Tensor:
    """Coefficients [N, 1, 3] that show a colour [N, 3] from everywhere."""
    return ((colors - 0.5) / Y00)[:, None]


def base_color(sh: Tensor) -> Tensor:
    """Colour [N, 3] without the direction: c_ind of the shading phase (paper, section Relightable 2DGS)."""
    return (0.5 + Y00 * sh[:, 0]).clamp_min(0)


def split(sh: Tensor) -> dict[str, Tensor]:
    """`sh` [N, 1, 3] and, where there are more, `sh_rest` [N, K - 1, 3]."""
    return {"sh": sh[:, :1]} | ({"sh_rest": sh[:, 1:]} if sh.shape[1] > 1 else {})


def join(parameters: Mapping[str, Tensor], degree: int | None = None) -> dict[str, Tensor]:
    """The parameters with one `sh` again, up to a degree."""
    joined = {name: x for name, x in parameters.items() if name != "sh_rest"}
    if "sh_rest" in parameters:
        count = parameters["sh_rest"].shape[1] if degree is None else (degree + 1) ** 2 - 1
        joined["sh"] = torch.cat([parameters["sh"], parameters["sh_rest"][:, :count]], dim=1)
    return joined
