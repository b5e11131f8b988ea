"""The structures and functions of `csrc/texgs_grid.h` as ctypes sees them."""

from __future__ import annotations

from ctypes import POINTER, Structure, c_float, c_int32, c_int64, c_void_p
from functools import cache

import torch
from torch import Tensor

from texgs.raster import native


class Grid(Structure):
    """`texgs_grid`."""

    _fields_ = [
        ("size", c_int32 * 3),
        ("lower", c_float * 3),
        ("spacing", c_float),
        ("degree", c_int32),
        ("n", c_int64),
        *((name, c_void_p) for name in ("masks", "first", "occupied", "distance", "rows", "density")),
    ]


class March(Structure):
    """`texgs_march`."""

    _fields_ = [
        ("n", c_int64),
        ("rays", c_void_p),
        ("background", c_float * 3),
        ("step", c_float),
        ("transmittance_min", c_float),
    ]


class Rule(Structure):
    """`texgs_rule`."""

    _fields_ = [
        (name, c_float) for name in ("rate_density", "rate_base", "rate_sh", "beta1", "beta2", "epsilon")
    ]


# One letter per argument, the stream left out: g grid, m march, r rule, p pointer, n int64, f float.
SIGNATURES = {
    "texgs_grid_occupy": "gpp",
    "texgs_grid_render": "gmppp p",
    "texgs_grid_backward": "pgm pppp",
    "texgs_grid_mark": "pgm p",
    "texgs_grid_total_variation": "g np ff pp",
    "texgs_grid_step": "gr pppp",
}
TYPES = {
    "g": POINTER(Grid),
    "m": POINTER(March),
    "r": POINTER(Rule),
    "p": c_void_p,
    "n": c_int64,
    "f": c_float,
}


@cache
def _describe(device_type: str) -> None:
    """Tell ctypes the argument types once per library."""
    lib = native.library(device_type)
    for name, signature in SIGNATURES.items():
        arguments = [TYPES[letter] for letter in signature if letter != " "]
        native.function(lib, name).argtypes = [*arguments, c_void_p]
    release = native.function(lib, "texgs_grid_release")
    release.argtypes, release.restype = [c_void_p], None


def call(name: str, *arguments: object, device: torch.device) -> None:
    """Call a function on structures, dense tensors (NULL for None) and numbers."""
    _describe(device.type)
    plain = [x.data_ptr() if isinstance(x, Tensor) else x for x in arguments]
    native.call(name, *plain, device=device)
