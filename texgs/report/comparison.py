"""Contact sheet of several fits: in views that they have not seen, each beside the truth, and its error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil
from pathlib import Path

import torch
from torch import Tensor

from texgs.core.errors import ArgumentError
from texgs.core.figures import COLUMNS, Cell, Row
from texgs.fields.field import Field
from texgs.report.fit_figure import compare, draw_visible
from texgs.volume.view_set import View

KEY = Cell("", words="of the worst channel\nred: too bright\nblue: too dark")


@torch.no_grad()
def write_comparison(
    path: str | Path,
    models: Mapping[str, Field],
    views: Mapping[str, View],
    reduce: int = 1,
    title: str = "",
) -> Path:
    """Draw fits side by side as PNG, in one step; the same models give the same bytes.

    Each view has a row with the view and each fit with its PSNR, and below it a row with the errors, as in
    the figure of one fit. More recipes than a row has room for go on in further rows, beside the view again.

    Args:
        path: the file to write.
        models: by recipe, at least one.
        views: by the name that stands beside them, at least one; all of one size.
        reduce: of the images, as in `images.load`.
        title: line at the top.

    Returns:
        The path.

    Raises:
        ArgumentError: if there is no view or no model, or the path is not writable.
    """
    if not views or not models:
        raise ArgumentError(f"{path}: expected models and views, got {len(models)} and {len(views)}")
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


def lines(recipes: Sequence[str]) -> list[Sequence[str]]:
    """Return the recipes in as few lines as there is room for beside a view, about as many in each."""
    count = ceil(len(recipes) / (COLUMNS - 1))
    size = ceil(len(recipes) / count)
    return [recipes[first : first + size] for first in range(0, len(recipes), size)]
