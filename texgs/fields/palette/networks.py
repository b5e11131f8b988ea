"""The networks of StyleRF-VolVis: density, light, palette colours and free colours of points in a unit cube.

Each but the light has a hash grid of its own, `NAME.table`. Layers `NAME.0`, `NAME.1`, ... have no bias. The
colour at a point is a mixture of the palette, or after an edit the free colour, plus a light that depends on
the direction.
"""

from collections.abc import Callable, Collection, Mapping
from itertools import count, pairwise
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional as F

from texgs.raster.hash_encoding import HashLevels, encode

HIDDEN_WIDTH = 64
GEOMETRY_FEATURES = 15  # features of a point from the density network
HARMONICS = 16  # spherical harmonics of the direction
MIN_SHARE = 0.05  # least share of a palette colour, before normalisation
MAX_LOG_DENSITY = 15.0  # larger logarithms would overflow
MAX_TABLE_ENTRY = 1e-4  # largest entry of a table at the start
TABLES = ("density", "palette", "free")  # networks with a hash grid

Parameters = Mapping[str, Tensor]
Activation = Callable[[Tensor], Tensor]


class PaletteColor(NamedTuple):
    """Output of the palette network at points."""

    color: Tensor  # [n, 3] without light
    shares: Tensor  # [n, P] of the palette's colours, summing to 1
    offsets: Tensor  # [n, P, 3] of these colours


def network_shapes(levels: HashLevels, colors: int) -> dict[str, tuple[int, int]]:
    """Return the shapes of all tensors for a number of palette colours, by network and layer."""
    table, features = (levels.rows, 2), levels.width
    widths = {
        "density": [features, HIDDEN_WIDTH, 1 + GEOMETRY_FEATURES],
        "trunk": [HARMONICS + GEOMETRY_FEATURES, HIDDEN_WIDTH, HIDDEN_WIDTH],
        "base": [HIDDEN_WIDTH, 3],
        "palette": [features, HIDDEN_WIDTH, GEOMETRY_FEATURES],
        "mixture": [GEOMETRY_FEATURES, 4 * colors + 1],
        "light": [HIDDEN_WIDTH, HIDDEN_WIDTH, HIDDEN_WIDTH, 1],
        "free": [features, HIDDEN_WIDTH, HIDDEN_WIDTH, 3],
    }
    layers = {
        f"{name}.{layer}": (after, before)
        for name, sizes in widths.items()
        for layer, (before, after) in enumerate(pairwise(sizes))
    }
    return {**{f"{name}.table": table for name in TABLES}, "palette.colors": (colors, 3), **layers}


def new_networks(
    names: Collection[str], levels: HashLevels, colors: int, generator: torch.Generator
) -> dict[str, Tensor]:
    """Make random networks: tables near 0, layers uniform up to in^-0.5 as in torch; no palette."""
    networks = {}
    for name, shape in network_shapes(levels, colors).items():
        network, part = name.split(".")
        if network in names and part != "colors":
            most = MAX_TABLE_ENTRY if part == "table" else shape[1] ** -0.5
            networks[name] = most * (2 * torch.rand(shape, generator=generator) - 1)
    return networks


def density(points: Tensor, parameters: Parameters, levels: HashLevels) -> tuple[Tensor, Tensor]:
    """Return the density [n], per world unit, and features [n, 15] for the networks of light."""
    out = perceptron(encode(points, parameters["density.table"], levels), parameters, "density")
    return out[:, 0].clamp_max(MAX_LOG_DENSITY).exp(), out[:, 1:]


def base_color(geometry: Tensor, harmonics: Tensor, parameters: Parameters) -> Tensor:
    """Return the colour [n, 3] from features of points and spherical harmonics [n, 16] of the direction."""
    return perceptron(_trunk(geometry, harmonics, parameters), parameters, "base").sigmoid()


def light(geometry: Tensor, harmonics: Tensor, parameters: Parameters) -> Tensor:
    """Return the contribution [n, 1] of the direction to all three channels."""
    return perceptron(_trunk(geometry, harmonics, parameters), parameters, "light")


def palette_color(points: Tensor, parameters: Parameters, levels: HashLevels) -> PaletteColor:
    """Mix the palette: radiance times the sum of share times (colour + offset)."""
    features = encode(points, parameters["palette.table"], levels)
    features = F.elu(perceptron(features, parameters, "palette", F.elu))
    colors = parameters["palette.colors"]
    out = perceptron(features, parameters, "mixture")
    raw, offsets, radiance = out.split([len(colors), 3 * len(colors), 1], dim=1)
    shares = F.softplus(raw) + MIN_SHARE
    shares = shares / shares.sum(1, keepdim=True)
    offsets = offsets.unflatten(1, (-1, 3))
    mixed = (shares[..., None] * (colors + offsets)).sum(1)
    return PaletteColor(F.softplus(radiance) * mixed, shares, offsets)


def free_color(points: Tensor, parameters: Parameters, levels: HashLevels) -> Tensor:
    """Return unlit, unbounded free colours [n, 3]."""
    return perceptron(encode(points, parameters["free.table"], levels), parameters, "free", F.elu)


def perceptron(x: Tensor, parameters: Parameters, name: str, activation: Activation = F.relu) -> Tensor:
    """Apply the layers NAME.0, NAME.1, ... with activations between them."""
    for layer in count():
        x = x @ parameters[f"{name}.{layer}"].T
        if f"{name}.{layer + 1}" not in parameters:
            return x
        x = activation(x)
    raise AssertionError("not reached")


def _trunk(geometry: Tensor, harmonics: Tensor, parameters: Parameters) -> Tensor:
    """Return the features [n, 64] shared by the base colour and the light."""
    return F.relu(perceptron(torch.cat([harmonics, geometry], dim=1), parameters, "trunk"))
