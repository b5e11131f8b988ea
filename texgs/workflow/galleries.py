"""What a gallery shows in each place: its row and its column, put together and checked."""

import re
from dataclasses import fields, replace
from pathlib import Path

from texgs.config.case import Case
from texgs.config.compose import preset
from texgs.config.gallery import NO_EDIT, GalleryCell, GalleryRow, Grid, GridKeys, ShotKeys
from texgs.config.project import members
from texgs.config.schema import Config
from texgs.core.errors import ConfigError
from texgs.core.lens import SIGHTS
from texgs.core.names import close
from texgs.edit.method import NO_METHOD, method_of
from texgs.workflow.edits import chain_of
from texgs.workflow.inputs import prepared_volume, sibling, with_recipe
from texgs.workflow.stage import edit_folder, fit_folder, result_file
from texgs.workflow.sweep import variant_words


def gallery_command(config: Config) -> str:
    """Return the command that makes the pictures; empty where it is no experiment of a file."""
    name = config.gallery.name
    return f"texgs run experiment={name}" if name in members("experiment") else ""


def gallery_grids(config: Config) -> list[Grid]:
    """Return what the stage reads of the pictures of all places."""
    return [grid for grid, _ in gallery_of(config)]


def gallery_inputs(config: Config) -> dict[str, Path]:
    """Return the scenes of all places, and the volume where one is shown."""
    scenes, shown = dict[str, Path](), set[str]()
    for grid, files in gallery_of(config):
        scenes |= files
        shown |= {cell.show for row in grid.rows for cell in row.pictures}
    return {**scenes, **(prepared_volume(config) if shown & {"volume", "error"} else {})}


def gallery_of(config: Config) -> list[tuple[Grid, dict[str, Path]]]:
    """Return the grids, each with the files of its scenes; rows and columns without pictures are left out."""
    grids = config.gallery.grids or [all_looks(config)]
    names = [grid.name for grid in grids]
    for name in names:
        if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]*", name) or names.count(name) > 1:
            raise ConfigError(f"gallery.grids: expected different names of files, got {name!r}")
    return [fill_grid(config, grid) for grid in grids]


def all_looks(config: Config) -> GridKeys:
    """Return a grid of the scene as fitted and all scenes with a new look, in three views."""
    if not config.edits:
        raise ConfigError("edits: expected some to show, such as edits=[glass,gold], got none")
    columns = [ShotKeys("volume", show="volume"), ShotKeys("as fitted")]
    for name in config.edits:
        able = takers(config, name, "gallery")
        edit = preset("edit", name).edit
        if edit.method != NO_METHOD and method_of(edit).is_look:
            titles = [name] if len(able) == 1 else [f"{name}, {recipe}" for recipe in able]
            columns += [ShotKeys(title, name, recipe) for title, recipe in zip(titles, able, strict=True)]
    words = "The volume, the scene of the first recipe as fitted, and all its new looks."
    rows = [ShotKeys(title, view=list(view)) for title, view in SIGHTS.items()]
    return GridKeys("gallery", words, rows, columns)


def fill_grid(config: Config, grid: GridKeys) -> tuple[Grid, dict[str, Path]]:
    """Return a grid with its pictures, and the files of their scenes by name."""
    where, files = f"gallery.grids.{grid.name}", dict[str, Path]()
    titles = [row.title for row in grid.rows]
    if repeated := [title for title in titles if titles.count(title) > 1]:
        raise ConfigError(f"{where}: expected rows with different titles, got {repeated[0]!r} twice")
    has_volume = config.dataset.views_folder is None
    cells = [
        [cell_of(config, combine_shots(row, column, has_volume), where) for column in grid.columns]
        for row in grid.rows
    ]
    kept = [number for number in range(len(grid.columns)) if any(row[number][0].show for row in cells)]
    rows = []
    for row, line in zip(grid.rows, cells, strict=True):
        files |= {cell.scene: file for cell, file in line if cell.show}
        if any(cell.show for cell, _ in line):
            rows.append(GalleryRow(row.title, [line[number][0] for number in kept]))
    if not rows:
        raise ConfigError(f"{where}: expected a picture in a row and a column, got none")
    caption = " ".join(filter(None, (grid.caption, config.gallery.note)))
    return Grid(grid.name, caption, [grid.columns[number].title for number in kept], rows), files


def combine_shots(row: ShotKeys, column: ShotKeys, has_volume: bool) -> ShotKeys:
    """Return what a row and a column say of the place that they share, with defaults for the rest."""
    said = {each.name: getattr(column, each.name) or getattr(row, each.name) for each in fields(ShotKeys)}
    show = said["show"] or "scene"
    if (row.show and column.show and row.show != column.show) or not (has_volume or show == "scene"):
        show = ""
    changes = [*row.changes, *column.changes]
    edit, view = said["edit"] or NO_EDIT, said["view"] or list(SIGHTS["front"])
    return ShotKeys(**{**said, "show": show, "edit": edit, "view": view, "changes": changes})


def cell_of(config: Config, shot: ShotKeys, where: str) -> tuple[GalleryCell, Path]:
    """Return a picture and the file of its scene, which is one of the experiment or of its stand-ins."""
    instead = config.stand_ins.of("edits", str(shot.edit))
    if instead and shot.edit not in (known := known_edits(config)):
        shot = replace(shot, edit=next((name for name in instead if name in known), shot.edit))
    for name, given in (("view", shot.view), ("light", shot.light)):
        if len(given) not in (0, 2) or not all(-90 <= polar <= 90 for polar in given[1:]):
            raise ConfigError(
                f"{where}.{name}: expected azimuth and polar angle, from -90 to 90 degrees, got {given}"
            )
    if shot.box and not is_inside(shot.box):
        raise ConfigError(f"{where}.box: expected left, top and side, from 0 to 1, got {shot.box}")
    of_fit, edit = fit_of(config, shot, where), str(shot.edit)
    is_plain = edit == NO_EDIT
    scene = f"{fit_folder(of_fit)}/{NO_EDIT if is_plain else edit_folder(of_fit, edit)}"
    said = {each.name: getattr(shot, each.name) for each in fields(GalleryCell)[1:]}
    return GalleryCell(scene, **said), result_file("compose", of_fit) if is_plain else sibling(of_fit, edit)


def is_inside(box: list[float]) -> bool:
    """Return whether a box is left, top and side of a part of the view."""
    return len(box) == 3 and min(box[:2]) >= 0 < box[2] and max(box[:2]) + box[2] <= 1 + 1e-9


def fit_of(config: Config, shot: ShotKeys, where: str) -> Config:
    """Return the configuration of the fit whose scene is shown: of a recipe and a variant."""
    recipes = recipes_of(config)
    if shot.fit is not None and shot.fit not in recipes:
        raise ConfigError(
            f"{where}.fit: expected one of {', '.join(recipes)}, got {shot.fit}{close(shot.fit, recipes)}"
        )
    able = takers(config, str(shot.edit), where)
    if shot.fit is not None and shot.fit not in able:
        raise ConfigError(f"{where}.fit: {shot.edit} does not work on {shot.fit}; choose another recipe")
    if not able:
        raise ConfigError(f"{where}.edit: {shot.edit} works on none of {', '.join(recipes)}; add a recipe")
    variants = list(variant_words(config))
    variant = shot.variant or (variants[0] if len(variants) == 1 else "")
    if variant not in (variants or [""]):
        expected = f"one of {', '.join(variants)}" if variants else "none without a sweep"
        hint = close(shot.variant or "", variants)
        raise ConfigError(f"{where}.variant: expected {expected}, got {shot.variant or 'none'}{hint}")
    of_fit = with_recipe(config, shot.fit or able[0]) if config.fits else config
    return replace(of_fit, variant=variant or of_fit.variant)


def recipes_of(config: Config) -> list[str]:
    """Return the recipes of an experiment."""
    return config.fits or [config.fit.name]


def takers(config: Config, edit: str, where: str) -> list[str]:
    """Return the recipes of the experiment that an edit works on."""
    recipes = recipes_of(config)
    if edit == NO_EDIT:
        return recipes
    if edit not in config.edits and edit not in (known := known_edits(config)):
        expected = ", ".join([NO_EDIT, *known])
        raise ConfigError(f"{where}.edit: expected one of {expected}, got {edit}{close(edit, known)}")
    method = method_of(preset("edit", edit).edit)
    if not config.fits:
        return [name for name in recipes if method.takes(config.fit.field)]
    return [name for name in recipes if method.takes(preset("fit", name).fit.field)]


def known_edits(config: Config) -> list[str]:
    """Return the edits of an experiment, and those that they start from."""
    return list(
        dict.fromkeys(
            each.config.edit.name for name in config.edits for each in chain_of(Case().edited(name))
        )
    )
