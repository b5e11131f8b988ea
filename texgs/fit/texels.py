"""The texture phase: geometry and material stay, surfels get colours that vary."""

from __future__ import annotations

import torch
from torch import Tensor

from texgs.core.errors import ArgumentError
from texgs.fields.surfels.model import Surfels
from texgs.fit.texture_adam import refine
from texgs.fit.texture_layout import look, offsets_of, sizes_for_budget, sizes_where_seen
from texgs.fit.texture_solve import solve
from texgs.volume.images import Images


def texturize(
    model: Surfels,
    images: Images,
    *,
    texels: int | None = None,
    sweeps: int = 3,
    iterations: int = 0,
    rate: float = 0.0025,
    palette_rate: float = 0.0,
    final: float = 0.1,
    ridge: float = 0.2,
    sparsity: float = 0.0,
    has_offset: bool = True,
    seed: int = 0,
    title: str = "texture",
) -> Surfels:
    """Give the surfels of a relightable model textures (the paper's section Textured Gaussian Primitives).

    Args:
        model: of stage shading.
        images: training views.
        texels: about how many, of one edge for all surfels; by default of about one pixel where they are
            seen.
        sweeps: of `solve` over all views.
        iterations: of `refine` afterwards.
        rate: of `refine` at the start, of texels.
        palette_rate: the same of the palette, which starts at the mean colour of the images; at 0 it stays.
        final: both at the end, relative to the start.
        ridge: of `solve`, relative: how strongly texels that are hardly seen stay where they are.
        sparsity: of `refine`, weight of the mean absolute value of the image of texels alone.
        has_offset: whether surfels keep their colours, as offsets from the palette, and texels start at 0;
            else texels take them over, as the paper has it.
        seed: of the order of views; with the same one, machine and versions, results are the same.
        title: of the progress bars.

    Returns:
        A model of stage texture; all other parameters are those of the model.

    Raises:
        ArgumentError: if the model is of another stage, or a number is out of range.
        FitError: if texels are no longer finite.
    """
    rates = {"rate": rate, "palette_rate": palette_rate, "final": final, "sparsity": sparsity}
    for name, value in {"sweeps": sweeps, "iterations": iterations, "ridge": ridge, **rates}.items():
        if not value >= 0:
            raise ArgumentError(f"{name}: expected 0 or more, got {value}")
    if model.stage != "shading":
        raise ArgumentError(f"model: expected stage shading, got {model.stage}; pass what that stage wrote")
    palette = mean_color(images).to(model.device)
    n, scales = len(model), model.parameters["scales"].exp()
    flat = textured(model, palette, torch.ones(n, 2, dtype=torch.int32, device=scales.device))
    sight = look(flat, images, title)
    sizes = sizes_where_seen(scales, sight) if texels is None else sizes_for_budget(scales, texels)
    result = textured(model, palette, sizes)
    if not has_offset:
        result = without_offset(result)
    if sweeps:
        result = solve(result, images, sight, sweeps=sweeps, ridge=ridge, seed=seed, title=title)
    if iterations:
        result = refine(result, images, iterations=iterations, **rates, seed=seed, title=title)
    return result


def textured(model: Surfels, palette: Tensor, sizes: Tensor) -> Surfels:
    """The model with texels 0 and its colours as offsets from the palette: it looks as before.

    Args:
        model: of stage shading.
        palette: [3].
        sizes: texels along u and v [N, 2], int32.
    """
    p = model.parameters
    texels = palette.new_zeros(int(sizes.long().prod(dim=1).sum()), 3)
    texture = {"palette": palette, "texels": texels, "sizes": sizes, "offsets": offsets_of(sizes)}
    return Surfels({**p, "colors": p["colors"] - palette, **texture}, model.shading, model.metadata)


def without_offset(model: Surfels) -> Surfels:
    """The model with the offsets of its surfels added to their texels, one surfel after the other."""
    p = model.parameters
    owners = torch.repeat_interleave(p["sizes"].long().prod(dim=1))
    moved = {"texels": p["texels"] + p["colors"][owners], "colors": torch.zeros_like(p["colors"])}
    return Surfels({**p, **moved}, model.shading, model.metadata)


def mean_color(images: Images) -> Tensor:
    """Mean colour [3] in [0, 1] of what all images show, weighted by alpha; black where they show nothing."""
    total = images.planes.new_zeros(4, dtype=torch.float64)
    for planes in images.planes:
        total += planes.sum(dim=(1, 2), dtype=torch.int64)
    color, alpha = total[:3], total[3]
    premultiplied = color - (255.0 * images.planes[:, 3].numel() - alpha)  # without the white behind
    return (premultiplied / alpha.clamp_min(1)).clamp(0, 1).float()
