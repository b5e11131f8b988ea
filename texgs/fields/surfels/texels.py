"""The list of the texels of all surfels: their owners, and their colours without light."""

from collections.abc import Mapping
from dataclasses import replace

import torch
from torch import Tensor

from texgs.fields.field import Field
from texgs.fields.surfels.model import Surfels

EXTENT = 6.0  # standard deviations that a texture spans along each tangent


def owners(parameters: Mapping[str, Tensor]) -> tuple[Tensor, Tensor]:
    """Return the place in the list [T] and the surfel [T] of all texels, sorted by surfel."""
    counts = parameters["sizes"].long().prod(1)  # [N]
    surfel = torch.repeat_interleave(counts)
    within = torch.arange(len(surfel), device=surfel.device) - offsets_of(parameters["sizes"])[surfel]
    return parameters["offsets"][surfel] + within, surfel


def offsets_of(sizes: Tensor) -> Tensor:
    """Return the index [N], int64, of each surfel's first texel, for ordered textures of sizes [N, 2]."""
    counts = sizes.long().prod(dim=1)
    return counts.cumsum(dim=0) - counts


def mean_texels(parameters: Mapping[str, Tensor]) -> Tensor:
    """Return the mean texel of each surfel [N, 3], float64."""
    texels = parameters["texels"].double()
    running = torch.cat([texels.new_zeros(1, 3), texels.cumsum(0)])  # [T + 1, 3]
    counts, offsets = parameters["sizes"].long().prod(1), parameters["offsets"]  # [N]
    return (running[offsets + counts] - running[offsets]) / counts[:, None]


def footprint(sizes: Tensor) -> Tensor:
    """Return the Gaussian weight [T] of each texel in its surfel, in order; each surfel's sum to 1."""
    owner = torch.repeat_interleave(sizes.long().prod(dim=1))  # [T]
    place = torch.arange(len(owner), device=owner.device) - offsets_of(sizes)[owner]
    columns, rows = sizes.long().unbind(dim=1)
    u = EXTENT * ((place % columns[owner]) + 0.5) / columns[owner] - EXTENT / 2
    v = EXTENT * ((place // columns[owner]) + 0.5) / rows[owner] - EXTENT / 2
    gaussian = torch.exp(-0.5 * (u.square() + v.square()))
    total = gaussian.new_zeros(len(sizes)).index_add_(0, owner, gaussian)
    return gaussian / total[owner]


def with_single_texels(model: Surfels, surfels: Tensor | None = None) -> Surfels:
    """Return the model with one texel, the mean under its Gaussian, for some surfels [N] bool, or for all."""
    p = model.parameters
    place, surfel = owners(p)
    texels, weights = p["texels"].clone(), footprint(p["sizes"])[:, None]
    means = torch.zeros_like(p["colors"]).index_add_(0, surfel, weights * texels[place])
    whole = torch.zeros_like(p["opacities"], dtype=torch.bool) if surfels is None else ~surfels
    texels[place] = torch.where(whole[surfel, None], texels[place], means[surfel])
    return with_first_texels(replace(model, parameters={**p, "texels": texels}), whole)


def spread_colors(colors: Tensor, plain: Surfels, model: Surfels) -> Tensor:
    """Spread one colour per surfel over a model's texels [T, 3], in their places.

    Colours are in places of the texels of the plain model: the same surfels, of which the first texel counts.
    """
    place, surfel = owners(model.parameters)
    texels = torch.zeros_like(model.parameters["texels"])
    return texels.index_copy_(0, place, colors[plain.parameters["offsets"][surfel]])


def reduce_constant_textures(field: Field) -> Field:
    """Reduce constant textures to one texel, without changing the look. Other fields stay unchanged."""
    if not isinstance(field, Surfels) or field.stage != "texture":
        return field
    place, surfel = owners(field.parameters)
    texels = field.parameters["texels"][place]
    differs = (texels != texels[offsets_of(field.parameters["sizes"])[surfel]]).any(1)
    is_whole = torch.zeros(len(field), dtype=torch.bool, device=place.device)
    return with_first_texels(field, is_whole.index_fill_(0, surfel[differs], True))


def with_first_texels(model: Surfels, whole: Tensor) -> Surfels:
    """Keep only the first texel of surfels outside the mask `whole` [N]; textures come in order."""
    p = model.parameters
    place, surfel = owners(p)
    kept = whole[surfel]
    kept[offsets_of(p["sizes"])] = True
    sizes = torch.where(whole[:, None], p["sizes"], 1)
    texture = {"texels": p["texels"][place[kept]], "sizes": sizes, "offsets": offsets_of(sizes)}
    return replace(model, parameters={**p, **texture})


def bare_colors(model: Surfels) -> Tensor:
    """Return c_ind of all texels [T, 3], in their places: palette + offset of the surfel + texel."""
    p = model.parameters
    place, surfel = owners(p)
    offsets = torch.zeros_like(p["texels"])
    offsets[place] = p["colors"][surfel]
    return p["palette"] + offsets + p["texels"]


def with_colors(model: Surfels, colors: Tensor, surfels: Tensor | None = None) -> Surfels:
    """Return the model with other colours without light: offsets are their means, texels the differences.

    Highlights are added to the colour of a surfel and clamped before its texels are: the mean has to be in
    that colour, or highlights would take on the hue that the surfel had before.

    Colors [T, 3] are bare ones of all texels, in their places in the list; surfels [N] bool are those that
    change, by default all.
    """
    p = model.parameters
    place, surfel = owners(p)
    mean = mean_texels({**p, "texels": colors}).to(colors)  # [N, 3]
    offsets = mean - p["palette"]
    if surfels is not None:
        offsets = torch.where(surfels[:, None], offsets, p["colors"])
        moved = surfels[surfel]
        place, surfel = place[moved], surfel[moved]
    changed = colors.index_select(0, place) - mean.index_select(0, surfel)
    texels = p["texels"].index_copy(0, place, changed)
    return replace(model, parameters={**p, "colors": offsets, "texels": texels})
