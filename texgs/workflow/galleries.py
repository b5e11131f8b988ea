"""What a gallery shows in each place: its row and its column, put together and checked."""

import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from texgs.config.compose import compose
from texgs.config.gallery import AS_FITTED, GridKeys, ShotKeys
from texgs.config.project import members
from texgs.config.schema import Config
from texgs.core.errors import ConfigError
from texgs.edit.method import method_of
from texgs.workflow.gallery_scenes import check_changes, fit_of, takers
from texgs.workflow.inputs import prepared_volume, sibling
from texgs.workflow.stage import edit_folder, fit_folder, made

FRONT, SIDE = [-90.0, 20.0], [0.0, 20.0]  # azimuth and polar angle of cameras, degrees
NUMBERS = {"view": 2, "light": 2, "box": 3}


@dataclass(frozen=True)
class Place:
    """One place of a grid."""

    shot: ShotKeys  # of its row and its column together
    scene: str  # key of its file among the inputs
    file: Path


def gallery_command(config: Config) -> str:
    """Return the command that makes the pictures; empty where it is no experiment of a file."""
    name = config.gallery.name
    return f"texgs run experiment={name}" if name in members("experiment") else ""


def gallery_grids(config: Config) -> list[dict[str, Any]]:
    """Return what the stage reads of the pictures of all places."""
    shown = []
    for grid, places in places_of(config):
        rows = [
            {"title": row.title, "pictures": [picture(place) for place in line]}
            for row, line in zip(grid.rows, places, strict=True)
        ]
        titles = [column.title for column in grid.columns]
        shown.append({"name": grid.name, "caption": grid.caption, "columns": titles, "rows": rows})
    return shown


def gallery_inputs(config: Config) -> dict[str, Path]:
    """The scenes of all places, and the volume where one is shown."""
    places = [place for _, rows in places_of(config) for row in rows for place in row if place.shot.show]
    scenes = {place.scene: place.file for place in places}
    needs_volume = any(place.shot.show != "scene" for place in places)
    return {**scenes, **(prepared_volume(config) if needs_volume else {})}


def picture(place: Place) -> dict[str, Any]:
    """What the stage reads of one place."""
    values = asdict(place.shot)
    read = ("show", "view", "fov_y", "box", "pixels", "light", "changes")
    return {"scene": place.scene, **{name: values[name] for name in read}}


def places_of(config: Config) -> list[tuple[GridKeys, list[list[Place]]]]:
    """The grids of a gallery, each with the places of its rows; rows and columns without any are left out."""
    grids = config.gallery.grids or [all_looks(config)]
    names = [grid.name for grid in grids]
    for name in names:
        if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]*", name) or names.count(name) > 1:
            raise ConfigError(f"gallery.grids: expected different names of files, got {name!r}")
    return [filled(config, grid) for grid in grids]


def filled(config: Config, grid: GridKeys) -> tuple[GridKeys, list[list[Place]]]:
    """A grid with its places."""
    where = f"gallery.grids.{grid.name}"
    titles = [row.title for row in grid.rows]
    if repeated := [title for title in titles if titles.count(title) > 1]:
        raise ConfigError(f"{where}: expected rows with different titles, got {repeated[0]!r} twice")
    has_volume = config.dataset.views_folder is None
    places = [
        [place_of(config, together(row, column, has_volume), where) for column in grid.columns]
        for row in grid.rows
    ]
    rows = [index for index, row in enumerate(places) if any(place.shot.show for place in row)]
    columns = [
        index for index in range(len(grid.columns)) if any(places[row][index].shot.show for row in rows)
    ]
    if not rows:
        raise ConfigError(f"{where}: expected a picture in a row and a column, got none")
    kept = GridKeys(grid.name, grid.caption, [grid.rows[i] for i in rows], [grid.columns[i] for i in columns])
    return kept, [[places[row][column] for column in columns] for row in rows]


def together(row: ShotKeys, column: ShotKeys, has_volume: bool) -> ShotKeys:
    """What a row and a column say of the place that they share, with defaults for what neither says."""
    said = {each.name: getattr(column, each.name) or getattr(row, each.name) for each in fields(ShotKeys)}
    show = said["show"] or "scene"
    if (row.show and column.show and row.show != column.show) or not (has_volume or show == "scene"):
        show = ""
    changes = [*row.changes, *column.changes]
    edit, view = said["edit"] or AS_FITTED, said["view"] or FRONT
    return ShotKeys(**{**said, "show": show, "edit": edit, "view": view, "changes": changes})


def place_of(config: Config, shot: ShotKeys, where: str) -> Place:
    """A place with the file of its scene."""
    for name, count in NUMBERS.items():
        given = getattr(shot, name)
        if given and (len(given) != count or (name == "box" and not is_inside(given))):
            expected = "left, top and side, from 0 to 1" if name == "box" else "azimuth and polar angle"
            raise ConfigError(f"{where}.{name}: expected {expected}, got {given}")
    of_fit = fit_of(config, shot, where)
    check_changes(config, shot, where)
    if shot.edit == AS_FITTED:
        return Place(shot, f"{fit_folder(of_fit)}/{AS_FITTED}", made("compose", of_fit))
    edit = str(shot.edit)
    return Place(shot, f"{fit_folder(of_fit)}/{edit_folder(of_fit, edit)}", sibling(of_fit, edit))


def is_inside(box: Sequence[float]) -> bool:
    """Whether a box is a part of the view."""
    left, top, side = box
    return min(left, top) >= 0 < side and max(left, top) + side <= 1 + 1e-9


def all_looks(config: Config) -> GridKeys:
    """The scene as fitted and all scenes of the experiment with a new look, in two views."""
    if not config.edits:
        raise ConfigError("edits: expected some to show, such as edits=[glass,gold], got none")
    columns = [ShotKeys("volume", show="volume"), ShotKeys("as fitted")]
    for name in config.edits:
        able = takers(config, name, "gallery")
        if method_of(compose((f"edit={name}",)).edit).is_look:
            titles = [name] if len(able) == 1 else [f"{name}, {recipe}" for recipe in able]
            columns += [ShotKeys(title, name, recipe) for title, recipe in zip(titles, able, strict=True)]
    words = "The volume, the scene of the first recipe as fitted, and all its new looks."
    rows = [ShotKeys("front", view=FRONT), ShotKeys("side", view=SIDE)]
    return GridKeys("gallery", words, rows, columns)
