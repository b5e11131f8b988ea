"""Stage `gallery`: show scenes of a data set and its volume in rows and columns, as an experiment says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texgs.core.progress import progress
from texgs.report.results import GalleryResult, Shown
from texgs.workflow.inputs import has_scene, is_first_recipe
from texgs.workflow.stage import Outcome, Rule, Stage
from texgs.workflow.stages.gallery_cells import GalleryCell, GalleryRenderer, RenderedCell
from texgs.workflow.stages.settings import OfScene

if TYPE_CHECKING:
    from texgs.config.schema import Config

ERRORS = (
    "Errors are those of the worst channel, four times enlarged, red where the scene is too bright and blue "
    "where it is too dark, with the PSNR of the picture."
)


@dataclass
class Row:
    """Places side by side."""

    title: str
    pictures: list[GalleryCell]


@dataclass
class Grid:
    """What one file shows."""

    name: str
    caption: str
    columns: list[str]
    rows: list[Row]


@dataclass
class Settings(OfScene):
    """What the stage reads of the configuration."""

    section: str
    size: int
    command: str
    grids: list[Grid]


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write a PNG for each grid.

    It reads scenes by the names that pictures have for them, and `volume` where one shows it.
    """
    from texgs.core.figures import write_grid

    renderer, shown, captions = GalleryRenderer(settings, inputs, settings.size), [], {}
    for grid in settings.grids:
        taken = pictures(grid, renderer, f"{settings.dataset}: {grid.name}")
        shown += entries(grid, taken)
        pixels = {title: [each.pixels for each in row] for title, row in taken.items()}
        below = {
            title: ["" if each.psnr is None else f"{each.psnr:.1f} dB" for each in row]
            for title, row in taken.items()
        }
        write_grid(output / f"{grid.name}.png", pixels, grid.columns, below)
        errors = ERRORS if any(map(any, below.values())) else ""
        made_by = f"Made by: {settings.command}" if settings.command else ""
        captions[f"{grid.name}.png"] = " ".join(filter(None, (grid.caption, errors, made_by)))
    return Outcome(GalleryResult(settings.section, shown), captions)


def pictures(grid: Grid, renderer: GalleryRenderer, title: str) -> dict[str, list[RenderedCell]]:
    """Return the pictures of each row by its title; those of one scene are taken together."""
    places = [(row.title, column, cell) for row in grid.rows for column, cell in enumerate(row.pictures)]
    places.sort(key=lambda place: place[2].scene)
    taken = {
        (row, column): renderer.render(cell)
        for row, column, cell in progress(places, title=title, unit="picture")
    }
    return {row.title: [taken[row.title, column] for column in range(len(row.pictures))] for row in grid.rows}


def entries(grid: Grid, taken: Mapping[str, list[RenderedCell]]) -> list[Shown]:
    """Return what is shown, in words and numbers."""
    return [
        Shown(grid.name, row, column, each.psnr)
        for row, line in taken.items()
        for column, each in zip(grid.columns, line, strict=True)
        if each.pixels is not None
    ]


def select(config: Config) -> dict[str, Any]:
    """Return what the stage reads: the pictures of all places, and what it takes to show the volume."""
    from texgs.workflow.galleries import gallery_settings  # not at the top: it loads Hydra

    return gallery_settings(config)


def inputs(config: Config) -> dict[str, Path]:
    """Return the scenes of all places, and the volume where one is shown."""
    from texgs.workflow.galleries import gallery_inputs

    return gallery_inputs(config)


def applies(config: Config) -> bool:
    """Return whether this is the first of the recipes and variants of an experiment with scenes to show."""
    from texgs.workflow.variants import changes

    variants = list(changes(config))
    shows_all = len(config.edits) > 1 and not variants
    if not has_scene(config) or not (config.gallery.grids or shows_all):
        return False
    first = variants[:1], config.sweep.seeds[:1], config.sweep.edit_seeds[:1]
    if variants and ([config.variant], [config.fit.seed], [config.edit.seed]) != first:
        return False
    return is_first_recipe(config)


STAGE = Stage(
    "gallery",
    order=170,
    help="show all looks of a data set side by side",
    rule=Rule("gallery", "{dataset}/gallery/{gallery}", target="galleries", gpu=("views", "fit")),
    schema=Settings,
    select=select,
    inputs=inputs,
    work=work,
    applies=applies,
)
