"""The functions of `csrc/texgs_losses.h` as ctypes sees them."""

from __future__ import annotations

from ctypes import c_float, c_int32, c_int64, c_void_p
from functools import cache

import torch
from torch import Tensor

from texgs.raster import native

# One letter per argument, the stream left out: p pointer, i int32, n int64, f float.
SIGNATURES = {
    "texgs_l1_dssim": "pp iii ff pp",
    "texgs_depth_to_normal": "ppp ii p",
    "texgs_depth_to_normal_backward": "ppp ii pp",
    "texgs_normal_consistency": "ppppp ii ppp",
    "texgs_bilateral_smoothness": "ppp iii pp",
    "texgs_blinn_phong": "n ppppp i pppp i pp",
    "texgs_blinn_phong_backward": "n ppppp i pppp i pp ppppppp",
    "texgs_spherical_harmonics": "n i ppp p",
    "texgs_spherical_harmonics_backward": "n i ppp pp pp",
}
TYPES = {"p": c_void_p, "i": c_int32, "n": c_int64, "f": c_float}


@cache
def _describe(device_type: str) -> None:
    """Tell ctypes the argument types once per library."""
    lib = native.library(device_type)
    for name, signature in SIGNATURES.items():
        arguments = [TYPES[letter] for letter in signature if letter != " "]
        native.function(lib, name).argtypes = [*arguments, c_void_p]


def call(name: str, *arguments: Tensor | float | None, device: torch.device) -> None:
    """Call a function on dense tensors (NULL for None) and numbers."""
    _describe(device.type)
    plain = [x.data_ptr() if isinstance(x, Tensor) else x for x in arguments]
    native.call(name, *plain, device=device)
