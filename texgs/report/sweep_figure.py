"""The figure of a sweep: measures over the swept value, and a picture of each edited scene."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from texgs.core.figures import DPI, as_picture, grid_rows, lay_out, new_figure, words
from texgs.core.names import SCENE
from texgs.report.metrics_files import Record
from texgs.report.sweep_table import measured_titles, natural, number, sweep_runs, variants
from texgs.report.table import SOURCES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

PANELS_PER_ROW, WIDTH = 4, 2.6  # panels in a row, and inches of each
HEIGHT, BAR = 2.2, 0.22  # inches of a panel over numbers, and of each bar
PICTURE_SIZE = 400  # pixels
LOGARITHMIC_RATIO = 30.0  # ratio of the ends that makes an axis logarithmic


def sweep_figure(records: Iterable[Record[Any]], name: str) -> Image.Image:
    """Draw a panel for each measure that differs between runs, and below them the edited scenes.

    Variants that are numbers make an axis, with the standard deviation over seeds; others have bars.
    """
    runs = sweep_runs(records, name)
    titles, pictures = titles_that_differ(runs), scene_pictures(runs)
    series = dict(list(variants(runs).groupby("series", sort=False)))
    names = sorted(set(runs["variant"]), key=natural)
    is_axis = all(number(variant) is not None for variant in names)
    tall = HEIGHT if is_axis else 0.6 + BAR * len(names) * len(series)
    rows = {label: [shown.get(variant) for variant in names] for label, shown in pictures.items()}
    grids = [lay_out(grid_rows(rows, names), columns=len(names))] if rows else []
    width = max(WIDTH * min(PANELS_PER_ROW, len(titles)), *(grid.get_figwidth() for grid in grids), 0)
    figure = new_figure(width, tall * -(-len(titles) // PANELS_PER_ROW) + 0.25, DPI)
    draw_panels(figure, titles, series, name, [] if is_axis else names)
    return stack([as_picture(each) for each in (figure, *grids)])


def stack(pictures: Sequence[Image.Image]) -> Image.Image:
    """Return pictures one below the other, on white."""
    width, height = max(each.width for each in pictures), sum(each.height for each in pictures)
    page, top = Image.new("RGB", (width, height), "white"), 0
    for each in pictures:
        page.paste(each, (0, top))
        top += each.height
    return page


def titles_that_differ(runs: DataFrame) -> dict[str, int]:
    """Return the measures that differ between runs, with digits; all measures if none differs."""
    titles = measured_titles(runs)
    counts = runs[list(titles)].nunique()
    for least in (1, 0):
        if shown := {title: digits for title, digits in titles.items() if counts[title] > least}:
            return shown
    return dict(list(titles.items())[:1])


def draw_panels(
    figure: Figure, titles: Mapping[str, int], series: Mapping[str, DataFrame], name: str, bars: Sequence[str]
) -> None:
    """Draw a panel for each measure, with a line or a bar for each of `bars` for each of the series."""
    rows, thick = -(-len(titles) // PANELS_PER_ROW), 0.8 / len(series)
    panels = figure.subplots(rows, min(PANELS_PER_ROW, len(titles)), squeeze=False).ravel()
    for axes, (title, digits) in zip(panels, titles.items(), strict=False):
        axes.set_title(words(title), fontsize=9)
        axes.tick_params(labelsize=7)
        for index, (label, table) in enumerate(series.items()):
            known = table[table[title].notna()]
            means, spread = known[title].tolist(), known[f"± {title}"].astype(float).fillna(0.0).tolist()
            if bars:
                shift = thick * (index - 0.5 * (len(series) - 1))
                places = [bars.index(each) + shift for each in known["variant"]]
                draw_bars(axes, places, means, spread, label, thick, digits)
            else:
                draw_line(axes, [float(each) for each in known["variant"]], means, spread, label)
        if bars:
            axes.set_yticks(range(len(bars)), [words(variant) for variant in bars], fontsize=7)
            axes.invert_yaxis()
    for axes in panels[len(titles) :]:
        axes.set_axis_off()
    figure.supxlabel("" if bars else words(name), fontsize=9)
    if len(series) > 1:
        named = panels[0].get_legend_handles_labels()
        figure.legend(*named, loc="outside upper left", ncols=len(series), fontsize=7, frameon=False)


def draw_line(
    axes: Axes, at: Sequence[float], means: Sequence[float], spread: Sequence[float], label: str
) -> None:
    """Draw means over the swept value, with standard deviations for several seeds."""
    axes.errorbar(at, means, spread, label=words(label), marker="o", markersize=3, linewidth=1, capsize=2)
    if at and min(at) > 0 and max(at) / min(at) > LOGARITHMIC_RATIO:
        axes.set_xscale("log")


def draw_bars(
    axes: Axes,
    places: Sequence[float],
    means: Sequence[float],
    spread: Sequence[float],
    label: str,
    thick: float,
    digits: int,
) -> None:
    """Draw a bar with its number for each variant, at its place."""
    bars = axes.barh(places, means, thick, xerr=spread if any(spread) else None, label=words(label))
    axes.bar_label(bars, [f"{value:.{digits}f}" for value in means], fontsize=6, padding=2)
    axes.margins(x=0.25)
    axes.locator_params(axis="x", nbins=4)


def scene_pictures(runs: DataFrame) -> dict[str, dict[str, np.ndarray]]:
    """Render pictures [H, W, 3] of the edited scenes by series and by variant, of the first seed each."""
    by_series: dict[str, dict[str, np.ndarray]] = {}
    for run in runs[runs["edit"] != ""].to_dict("records"):
        by_variant = by_series.setdefault(run["series"], {})
        scene = run[SOURCES][0].with_name(SCENE)
        if run["variant"] not in by_variant and scene.is_file():
            by_variant[run["variant"]] = picture(scene)
    return {series: by_variant for series, by_variant in by_series.items() if by_variant}


def picture(path: Path) -> np.ndarray:
    """Render a scene from the front."""
    from texgs.core.lens import SIGHTS
    from texgs.scene.film import frames_of
    from texgs.scene.scene_file import read_scene
    from texgs.scene.shot import Shot

    scene, (azimuth, polar) = read_scene(path), SIGHTS["front"]
    camera = Shot(azimuth=azimuth, polar=polar, width=PICTURE_SIZE).camera(scene.framed())
    return next(frames_of(scene, [(camera, scene)], "cpu"))
