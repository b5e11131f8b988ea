"""Stage `gallery`: show scenes of a data set and its volume in rows and columns, as an experiment says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from texgs.config.compose import preset
from texgs.config.gallery import Grid
from texgs.edit.method import method_of
from texgs.report.results import GalleryResult, Shown
from texgs.volume.basic_tfs import basic_tfs_of
from texgs.workflow.edits import looks_of
from texgs.workflow.galleries import gallery_command, gallery_grids, gallery_inputs
from texgs.workflow.inputs import has_scene, is_first_recipe
from texgs.workflow.stage import Config, Outcome, Rule, Stage, read
from texgs.workflow.stages.settings import OfScene, OfVolume
from texgs.workflow.sweep import variant_words

if TYPE_CHECKING:
    from texgs.core.figures import Row

ERRORS = (
    "Errors are those of the worst channel, four times enlarged, red where the scene is too bright and blue "
    "where it is too dark, with the PSNR of the picture."
)
GIVEN = "Below them what they were given: basic transfer functions, and pictures or instructions."


def given(config: Config, follows: str) -> dict[str, str]:
    """Return the pictures or instructions of a comparison by basic TF; none where grids say what is shown."""
    edits = [preset("edit", name).edit for name in config.edits if config.edit.looks]
    own = [edit for edit in edits if method_of(edit).follows == follows and not config.gallery.grids]
    return looks_of(replace(config, edit=replace(own[0], looks=True))) if own else {}


@dataclass(kw_only=True)
class Settings(OfScene, OfVolume):
    """What the stage reads of the configuration."""

    section: str = read("gallery.section")
    size: int = read("gallery.size")
    command: str = read(gallery_command)
    grids: list[Grid] = read(gallery_grids)
    styles: dict[str, str] = read(partial(given, follows="style"))
    instructions: dict[str, str] = read(partial(given, follows="instruction"))


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write a PNG for each grid.

    It reads scenes by the names that pictures have for them, and `volume` where one shows it.
    """
    from texgs.core.check import torch_device
    from texgs.core.figures import write_grid
    from texgs.report.gallery import GalleryRenderer, render_rows

    scenes = {name: path for name, path in inputs.items() if name != "volume"}
    device, shown, captions = torch_device(settings.fit.device), [], {}
    renderer = GalleryRenderer(scenes, settings.views.fov_y, settings.size, device)
    for grid in settings.grids:
        taken = render_rows(grid, renderer, f"{settings.dataset}: {grid.name}")
        shown += [
            Shown(grid.name, row, column, each.psnr)
            for row, line in taken.items()
            for column, each in zip(grid.columns, line, strict=True)
            if each.pixels is not None
        ]
        pixels = {title: [each.pixels for each in row] for title, row in taken.items()}
        below = {
            title: ["" if each.psnr is None else f"{each.psnr:.1f} dB" for each in row]
            for title, row in taken.items()
        }
        more = given_rows(settings, inputs)
        write_grid(output / f"{grid.name}.png", pixels, grid.columns, below, more)
        errors = ERRORS if any(map(any, below.values())) else ""
        made_by = f"Made by: {settings.command}" if settings.command else ""
        told = grid.caption, GIVEN if more else "", errors, made_by
        captions[f"{grid.name}.png"] = " ".join(filter(None, told))
    return Outcome(GalleryResult(settings.section, shown), captions)


def given_rows(settings: Settings, inputs: Mapping[str, Path]) -> list[Row]:
    """Return the row of what looks of a comparison were given; none of other galleries."""
    from texgs.report.given_row import given_row, tf_plot

    if not settings.styles and not settings.instructions:
        return []
    plot = None
    if volume := inputs.get("volume"):
        plot = tf_plot(volume, basic_tfs_of(volume, settings.basic_tfs, settings.tf_values))
    return [given_row(plot, settings.styles, settings.instructions, inputs.values())]


def applies(config: Config) -> bool:
    """Return whether this is the first of the recipes and variants of an experiment with scenes to show."""
    variants = list(variant_words(config))
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
    rule=Rule("gallery", "{dataset}/gallery/{gallery}", target="galleries", gpu=("fit",), swept=True),
    inputs=gallery_inputs,
    work=work,
    applies=applies,
)
