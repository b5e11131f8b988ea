"""Stage `gallery`: show scenes of a data set and its volume in rows and columns, as an experiment says."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from texgs.core.progress import progress
from texgs.report.results import GalleryResult, Shown
from texgs.report.strip import write_strip
from texgs.workflow.stages.outcome import Outcome
from texgs.workflow.stages.settings import OfScene
from texgs.workflow.stages.shots import Shot, Studio, Taken

ERRORS = (
    "Errors are those of the worst channel, four times enlarged, red where the scene is too bright and blue "
    "where it is too dark, with the PSNR of the picture."
)


@dataclass
class Row:
    """Places side by side."""

    title: str
    pictures: list[Shot]


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

    Args:
        settings: of the job.
        inputs: scenes by the names that pictures have for them, and `volume` where one shows it.
        output: folder.
    """
    studio, shown, captions = Studio(settings, inputs, settings.size), [], {}
    for grid in settings.grids:
        taken = pictures(grid, studio, f"{settings.dataset}: {grid.name}")
        shown += entries(grid, taken)
        pixels = {title: [each.pixels for each in row] for title, row in taken.items()}
        below = {
            title: ["" if each.psnr is None else f"{each.psnr:.1f} dB" for each in row]
            for title, row in taken.items()
        }
        write_strip(output / f"{grid.name}.png", pixels, grid.columns, below)
        errors = ERRORS if any(map(any, below.values())) else ""
        made_by = f"Made by: {settings.command}" if settings.command else ""
        captions[f"{grid.name}.png"] = " ".join(filter(None, (grid.caption, errors, made_by)))
    return Outcome(GalleryResult(settings.section, shown), captions)


def pictures(grid: Grid, studio: Studio, title: str) -> dict[str, list[Taken]]:
    """The pictures of each row by its title; those of one scene are taken together."""
    places = [(row.title, column, shot) for row in grid.rows for column, shot in enumerate(row.pictures)]
    places.sort(key=lambda place: place[2].scene)
    taken = {
        (row, column): studio.take(shot)
        for row, column, shot in progress(places, title=title, unit="picture")
    }
    return {row.title: [taken[row.title, column] for column in range(len(row.pictures))] for row in grid.rows}


def entries(grid: Grid, taken: Mapping[str, list[Taken]]) -> list[Shown]:
    """What is shown, in words and numbers."""
    return [
        Shown(grid.name, row, column, each.psnr)
        for row, line in taken.items()
        for column, each in zip(grid.columns, line, strict=True)
        if each.pixels is not None
    ]
