"""Figures of fits beside unseen views: one fit phase by phase with its maps, or several fits."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import ceil
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from texgs.core.errors import ArgumentError
from texgs.core.figures import COLUMNS, Cell, Row, Scale, draw
from texgs.fields.field import Field
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import material
from texgs.fitting.losses import material_maps
from texgs.metrics.quality import psnr
from texgs.raster.shading import MATERIAL
from texgs.volume.images import over_white, smaller
from texgs.volume.view_set import View, ViewSet

VISIBLE_ALPHA = 2 / 255  # alpha
ERROR_GAIN = 4  # an error of a quarter has the full colour
DIVERGING = "bwr"  # of matplotlib; 0 is white
ERROR = Scale(-1 / ERROR_GAIN, 1 / ERROR_GAIN, DIVERGING)  # red where too bright, blue where too dark
MARGIN = 1.06  # side of the shown crop, relative to the visible part
KEY = Cell("", words="of the worst channel\nred: too bright\nblue: too dark")


@torch.no_grad()
def shown_views(views: ViewSet) -> dict[str, View]:
    """Return two test views by label, or training views without test views."""
    split, candidates = ("test", views.test) if views.test else ("training", views.train)
    return {f"{split} view {index}": candidates[index] for index in sorted({0, len(candidates) // 3})}


def write_fit_figure(
    path: str | Path,
    models: Mapping[str, Field],
    views: Mapping[str, View],
    reduce: int = 1,
    title: str = "",
) -> Path:
    """Draw a fit beside its views as PNG, in one step; the same models give the same bytes.

    A row for each view: the view, the model after each phase with its PSNR, and the error of the last one,
    that of the worst channel with its sign, four times enlarged. Then the maps of the last model in the first
    view: normals, depth, alpha and material. All cells show the same part of the frame, on white; PSNR is of
    the whole frame. Views are all of one size.
    """
    require_both(path, models, views)
    compared = [compare(models, view, reduce) for view in views.values()]
    rows = [Row(name, cells) for name, (cells, _) in zip(views, compared, strict=True)]
    name, view = next(iter(views.items()))
    rows.append(Row(name, maps(list(models.values())[-1], view, reduce)))
    return draw_visible(path, rows, torch.stack([visible for _, visible in compared]).any(dim=0), title)


@torch.no_grad()
def write_comparison(
    path: str | Path, models: Mapping[str, Field], views: Mapping[str, View], reduce: int = 1, title: str = ""
) -> Path:
    """Draw fits by recipe side by side as PNG, in one step; arguments are those of `write_fit_figure`.

    Each view has a row with the view and each fit with its PSNR, and below it a row with the errors, as in
    the figure of one fit. More recipes than a row has room for go on in further rows, beside the view again.
    """
    require_both(path, models, views)
    rows: list[Row] = []
    visible: list[Tensor] = []
    for name, view in views.items():
        for recipes in lines(list(models)):
            compared = [compare({recipe: models[recipe]}, view, reduce) for recipe in recipes]
            truth, _, _ = compared[0][0]
            rows.append(Row(name, [truth, *(fit for (_, fit, _), _ in compared)]))
            rows.append(Row("errors", [KEY, *(error for (_, _, error), _ in compared)]))
            visible += [where for _, where in compared]
    return draw_visible(path, rows, torch.stack(visible).any(dim=0), title)


def require_both(path: str | Path, models: Mapping[str, Field], views: Mapping[str, View]) -> None:
    """Raise ArgumentError without a model or a view."""
    if not views or not models:
        raise ArgumentError(f"{path}: expected models and views, got {len(models)} and {len(views)}")


def lines(recipes: Sequence[str]) -> list[Sequence[str]]:
    """Split the recipes into few lines of similar length that fit beside a view."""
    count = ceil(len(recipes) / (COLUMNS - 1))
    size = ceil(len(recipes) / count)
    return [recipes[first : first + size] for first in range(0, len(recipes), size)]


def draw_visible(path: str | Path, rows: list[Row], visible: Tensor, title: str) -> Path:
    """Draw all cells, cropped around the visible part [H, W]."""
    box = frame(visible)
    return draw(path, [Row(row.name, [crop(cell, box) for cell in row.cells]) for row in rows], title)


def compare(models: Mapping[str, Field], view: View, reduce: int) -> tuple[list[Cell], Tensor]:
    """Return the cells of one view, and the mask [H, W] visible in it or one of its renderings."""
    planes = over_white(view, reduce)
    truth, visible = planes[:3].permute(1, 2, 0), planes[3] > VISIBLE_ALPHA
    height, width = visible.shape
    cells = [Cell("ground truth", truth, f"PSNR over {width} × {height} pixels")]
    for phase, model in models.items():
        image = model.render(smaller(view.camera, reduce).to(model.device), view.light)
        color = image.color.cpu().clamp(0, 1)
        visible = visible | (image.alpha.cpu() > VISIBLE_ALPHA)
        cells.append(Cell(phase, color, f"PSNR {psnr(color, truth):.2f} dB"))
    cells.append(Cell("error (red: too bright)", ERROR(signed_error(color, truth)), scale=ERROR))
    return cells, visible


def signed_error(image: Tensor, target: Tensor) -> Tensor:
    """Return signed errors [H, W] of the worst channel; positive if the image is too bright."""
    error = image - target
    return error.gather(2, error.abs().argmax(dim=2, keepdim=True))[..., 0]


def maps(model: Field, view: View, reduce: int) -> list[Cell]:
    """Return the cells of depth and alpha in one view; for surfels also normals and material."""
    camera = smaller(view.camera, reduce).to(model.device)
    has_normals = isinstance(model, Surfels)
    image = model.render(camera, view.light, outputs=("normal", "depth") if has_normals else ("depth",))
    alpha, depth = image.alpha.cpu(), image.depth.cpu()  # type: ignore[union-attr]
    cover, grey = alpha[..., None], Scale(0, 1, "gray")
    cells = [map_cell("depth, world units", depth, alpha), Cell("alpha", grey(alpha), scale=grey)]
    if not isinstance(model, Surfels):
        return cells
    normal = image.normal.cpu()  # type: ignore[union-attr]
    cells.insert(0, Cell("normals", (0.5 * (normal + cover) + 1 - cover).clamp(0, 1), "xyz as RGB"))
    features = material_maps(model.parameters, model.shading)
    if features is None:
        factors = material(model.parameters, model.shading.material)
        lines = [f"{name:9} {value.item():6.3f}" for name, value in factors.items()]
        return [*cells, Cell("material of all surfels", words="\n".join(lines))]
    blended = model.rasterized(camera, features=features).color.cpu()
    means = (blended / cover.clamp_min(1e-6)).unbind(dim=2)  # over the surfels in a pixel
    return [*cells, *(map_cell(name, mean, alpha) for name, mean in zip(MATERIAL, means, strict=True))]


def map_cell(title: str, values: Tensor, alpha: Tensor) -> Cell:
    """Return the values [H, W] as colours over white, from the lowest percent of them to the highest."""
    seen = values[alpha > 0.1].numpy()
    low, high = np.percentile(seen, (1, 99)) if seen.size else (0.0, 1.0)
    scale = Scale(float(low), float(high) if high > low else float(low) + 1)
    return Cell(title, torch.lerp(torch.ones(3), scale(values), alpha[..., None]).clamp(0, 1), scale=scale)


def frame(visible: Tensor) -> tuple[slice, slice]:  # [H, W]
    """Return rows and columns of the smallest part of an image, of its aspect, with all that is visible."""
    places = visible.nonzero()
    if not len(places):
        return slice(None), slice(None)
    first, last = places.amin(dim=0), places.amax(dim=0) + 1
    whole = torch.tensor(visible.shape)
    size = (MARGIN * ((last - first) / whole).max() * whole).ceil().long().minimum(whole)
    start = torch.div(first + last - size, 2, rounding_mode="floor").clamp_min(0).minimum(whole - size)
    rows, columns = (slice(int(a), int(a + n)) for a, n in zip(start, size, strict=True))
    return rows, columns


def crop(cell: Cell, box: tuple[slice, slice]) -> Cell:
    """Crop a cell's picture to a box."""
    return cell if cell.pixels is None else replace(cell, pixels=cell.pixels[box])
