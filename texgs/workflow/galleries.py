"""What a gallery shows in each place: its row and its column, put together and checked."""

import re
from dataclasses import dataclass, fields, replace
from pathlib import Path

from texgs.config.compose import compose
from texgs.config.gallery import AS_FITTED, GridKeys, ShotKeys
from texgs.config.project import members
from texgs.config.schema import Config
from texgs.core.errors import ConfigError
from texgs.core.names import close
from texgs.edit.method import NO_METHOD, method_of
from texgs.workflow.edits import added_parts, ancestry, chain
from texgs.workflow.inputs import prepared_volume, sibling, with_recipe
from texgs.workflow.locate import tf_names
from texgs.workflow.stage import edit_folder, fit_folder, made
from texgs.workflow.sweep import changes

FRONT, SIDE, ABOVE = [-90.0, 20.0], [0.0, 20.0], [-130.0, 50.0]  # azimuth, polar angle of cameras, degrees
ANYWHERE = ("background", "light")  # changes of the whole scene


@dataclass
class GalleryCell:
    """What the configuration says of one picture, see `ShotKeys`."""

    scene: str  # its name among the inputs
    show: str  # scene, volume, error, or "" for nothing
    view: list[float]
    fov_y: float | None
    box: list[float]
    pixels: int | None
    light: list[float]
    changes: list[str]


@dataclass
class GalleryRow:
    """Places side by side."""

    title: str
    pictures: list[GalleryCell]


@dataclass
class Grid:
    """What one file shows."""

    name: str
    caption: str
    columns: list[str]
    rows: list[GalleryRow]


@dataclass(frozen=True)
class Place:
    """One place of a grid."""

    shot: ShotKeys  # of its row and its column together
    scene: str  # key of its file among the inputs
    file: Path

    def picture(self) -> GalleryCell:
        """Return what the stage reads of the place."""
        said = {each.name: getattr(self.shot, each.name) for each in fields(GalleryCell)[1:]}
        return GalleryCell(self.scene, **said)


def gallery_command(config: Config) -> str:
    """Return the command that makes the pictures; empty where it is no experiment of a file."""
    name = config.gallery.name
    return f"texgs run experiment={name}" if name in members("experiment") else ""


def gallery_grids(config: Config) -> list[Grid]:
    """Return what the stage reads of the pictures of all places."""
    shown = []
    for grid, places in places_of(config):
        rows = [
            GalleryRow(row.title, [place.picture() for place in line])
            for row, line in zip(grid.rows, places, strict=True)
        ]
        caption = " ".join(filter(None, (grid.caption, config.gallery.note)))
        shown.append(Grid(grid.name, caption, [column.title for column in grid.columns], rows))
    return shown


def gallery_inputs(config: Config) -> dict[str, Path]:
    """Return the scenes of all places, and the volume where one is shown."""
    places = [place for _, rows in places_of(config) for row in rows for place in row if place.shot.show]
    scenes = {place.scene: place.file for place in places}
    needs_volume = any(place.shot.show != "scene" for place in places)
    return {**scenes, **(prepared_volume(config) if needs_volume else {})}


def places_of(config: Config) -> list[tuple[GridKeys, list[list[Place]]]]:
    """Return the grids with the places of their rows; rows and columns without any are left out."""
    grids = config.gallery.grids or [all_looks(config)]
    names = [grid.name for grid in grids]
    for name in names:
        if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]*", name) or names.count(name) > 1:
            raise ConfigError(f"gallery.grids: expected different names of files, got {name!r}")
    return [filled(config, grid) for grid in grids]


def all_looks(config: Config) -> GridKeys:
    """Return a grid of the scene as fitted and all scenes with a new look, in three views."""
    if not config.edits:
        raise ConfigError("edits: expected some to show, such as edits=[glass,gold], got none")
    columns = [ShotKeys("volume", show="volume"), ShotKeys("as fitted")]
    for name in config.edits:
        able = takers(config, name, "gallery")
        edit = compose((f"edit={name}",)).edit
        if edit.method != NO_METHOD and method_of(edit).is_look:
            titles = [name] if len(able) == 1 else [f"{name}, {recipe}" for recipe in able]
            columns += [ShotKeys(title, name, recipe) for title, recipe in zip(titles, able, strict=True)]
    words = "The volume, the scene of the first recipe as fitted, and all its new looks."
    views = {"front": FRONT, "side": SIDE, "above": ABOVE}
    rows = [ShotKeys(title, view=view) for title, view in views.items()]
    return GridKeys("gallery", words, rows, columns)


def filled(config: Config, grid: GridKeys) -> tuple[GridKeys, list[list[Place]]]:
    """Return a grid with its places."""
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
    columns = [index for index in range(len(grid.columns)) if any(row[index].shot.show for row in places)]
    if not rows:
        raise ConfigError(f"{where}: expected a picture in a row and a column, got none")
    kept = GridKeys(grid.name, grid.caption, [grid.rows[i] for i in rows], [grid.columns[i] for i in columns])
    return kept, [[places[row][column] for column in columns] for row in rows]


def together(row: ShotKeys, column: ShotKeys, has_volume: bool) -> ShotKeys:
    """Return what a row and a column say of the place that they share, with defaults for the rest."""
    said = {each.name: getattr(column, each.name) or getattr(row, each.name) for each in fields(ShotKeys)}
    show = said["show"] or "scene"
    if (row.show and column.show and row.show != column.show) or not (has_volume or show == "scene"):
        show = ""
    changes = [*row.changes, *column.changes]
    edit, view = said["edit"] or AS_FITTED, said["view"] or FRONT
    return ShotKeys(**{**said, "show": show, "edit": edit, "view": view, "changes": changes})


def place_of(config: Config, shot: ShotKeys, where: str) -> Place:
    """Return a place with the file of its scene, which it is required to have, or of one that stands in."""
    if len(instead := chain(config.stand_ins.edits, str(shot.edit))) > 1:
        known = known_edits(config)
        shot = replace(shot, edit=next((name for name in instead if name in known), shot.edit))
    for name, given in (("view", shot.view), ("light", shot.light)):
        if len(given) not in (0, 2) or not all(-90 <= polar <= 90 for polar in given[1:]):
            raise ConfigError(
                f"{where}.{name}: expected azimuth and polar angle, from -90 to 90 degrees, got {given}"
            )
    if shot.box and not is_inside(shot.box):
        raise ConfigError(f"{where}.box: expected left, top and side, from 0 to 1, got {shot.box}")
    of_fit, edit = fit_of(config, shot, where), str(shot.edit)
    check_changes(config, shot, where)
    if edit == AS_FITTED:
        return Place(shot, f"{fit_folder(of_fit)}/{AS_FITTED}", made("compose", of_fit))
    return Place(shot, f"{fit_folder(of_fit)}/{edit_folder(of_fit, edit)}", sibling(of_fit, edit))


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
    variants = list(changes(config))
    if (shot.variant or "") not in (variants or [""]):
        expected = f"one of {', '.join(variants)}" if variants else "none without a sweep"
        hint = close(shot.variant or "", variants)
        raise ConfigError(f"{where}.variant: expected {expected}, got {shot.variant or 'none'}{hint}")
    of_fit = with_recipe(config, shot.fit or able[0]) if config.fits else config
    return replace(of_fit, variant=shot.variant or of_fit.variant)


def recipes_of(config: Config) -> list[str]:
    """Return the recipes of an experiment."""
    return config.fits or [config.fit.name]


def takers(config: Config, edit: str, where: str) -> list[str]:
    """Return the recipes of the experiment that an edit works on."""
    recipes = recipes_of(config)
    if edit == AS_FITTED:
        return recipes
    if edit not in config.edits and edit not in (known := known_edits(config)):
        expected = ", ".join([AS_FITTED, *known])
        raise ConfigError(f"{where}.edit: expected one of {expected}, got {edit}{close(edit, known)}")
    method = method_of(compose((f"edit={edit}",)).edit)
    if not config.fits:
        return [name for name in recipes if method.takes(config.fit.field)]
    return [name for name in recipes if method.takes(compose((f"fit={name}",)).fit.field)]


def known_edits(config: Config) -> list[str]:
    """Return the edits of an experiment, and those that they start from."""
    return list(dict.fromkeys(each.name for name in config.edits for each in ancestry(name)))


def check_changes(config: Config, shot: ShotKeys, where: str) -> None:
    """Require of changes that the parts are there which they change, and of parts their keys."""
    if not shot.changes:
        return
    from texgs.scene.scene_file import SEGMENT_KEYS

    parts = models = tf_names(config)
    clicked = f"dataset.part.model='{config.dataset.part.model}'"
    for edit in ancestry(str(shot.edit), clicked) if shot.edit != AS_FITTED else ():
        parts = [*parts, *added_parts(edit, models)]
    for change in shot.changes:
        name, is_change, _ = change.partition("=")
        part, dot, key = name.rpartition(".") if "." in name else (name, "", "")
        if not is_change or part not in (*parts, *ANYWHERE):
            raise ConfigError(
                f"{where}.changes: expected PART.KEY=VALUE with one of {', '.join(parts)}, got "
                f"{change}{close(part, parts)}"
            )
        if dot and part not in ANYWHERE and key not in SEGMENT_KEYS:
            expected = ", ".join(SEGMENT_KEYS)
            raise ConfigError(
                f"{where}.changes: expected {part} with one of {expected}, got {change}"
                f"{close(key, SEGMENT_KEYS)}"
            )
