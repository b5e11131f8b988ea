"""Stage `gallery`: show scenes of a data set and its volume in rows and columns, as an experiment says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from texgs.config.compose import compose
from texgs.core.progress import progress
from texgs.edit.method import method_of
from texgs.report.results import GalleryResult, Shown
from texgs.workflow.edits import looks_of
from texgs.workflow.galleries import GalleryCell, Grid, gallery_command, gallery_grids, gallery_inputs
from texgs.workflow.inputs import has_scene, is_first_recipe
from texgs.workflow.stage import Config, Outcome, Rule, Stage, read
from texgs.workflow.stages.settings import OfScene, OfVolume, basic_tfs_of
from texgs.workflow.sweep import changes

if TYPE_CHECKING:
    import numpy as np

    from texgs.core.camera import Camera
    from texgs.core.figures import Row
    from texgs.scene.session import Session
    from texgs.scene.twin import Twin

ERRORS = (
    "Errors are those of the worst channel, four times enlarged, red where the scene is too bright and blue "
    "where it is too dark, with the PSNR of the picture."
)
GIVEN = "Below them what they were given: basic transfer functions, and pictures or instructions."


def given(config: Config, follows: str) -> dict[str, str]:
    """Return the pictures or instructions of a comparison by basic TF; none where grids say what is shown."""
    edits = [compose((f"edit={name}",)).edit for name in config.edits if config.edit.looks]
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


@dataclass(frozen=True, eq=False)
class RenderedCell:
    """A picture, or nothing."""

    pixels: np.ndarray | None = None  # [H, W, 3] in [0, 1]
    psnr: float | None = None  # against the volume, where the picture shows the difference, dB


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write a PNG for each grid.

    It reads scenes by the names that pictures have for them, and `volume` where one shows it.
    """
    from texgs.core.figures import write_grid

    renderer, shown, captions = GalleryRenderer(settings, inputs, settings.size), [], {}
    for grid in settings.grids:
        taken = pictures(grid, renderer, f"{settings.dataset}: {grid.name}")
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


def pictures(grid: Grid, renderer: GalleryRenderer, title: str) -> dict[str, list[RenderedCell]]:
    """Return the pictures of each row by its title; those of one scene are taken together."""
    places = [(row.title, column, cell) for row in grid.rows for column, cell in enumerate(row.pictures)]
    places.sort(key=lambda place: place[2].scene)
    taken = {
        (row, column): renderer.render(cell)
        for row, column, cell in progress(places, title=title, unit="picture")
    }
    return {row.title: [taken[row.title, column] for column in range(len(row.pictures))] for row in grid.rows}


class GalleryRenderer:
    """Takes pictures. A scene stays open until one of another is taken.

    Args:
        settings: of a job that shows scenes and their volume.
        inputs: scene files by name.
        size: pixels of each side of a picture.
    """

    def __init__(self, settings: OfScene, inputs: Mapping[str, Path], size: int) -> None:
        from texgs.core.check import torch_device
        from texgs.scene.scene_file import read_scene

        first = next(path for name, path in inputs.items() if name != "volume")
        self._lens = read_scene(first).framed().lens(settings.views.fov_y)  # of all pictures alike
        self._device = torch_device(settings.fit.device)
        self._inputs, self._size = inputs, size
        self._open: tuple[str, Session] | None = None
        self._twin: Twin | None = None  # of the scene that is open

    def render(self, cell: GalleryCell) -> RenderedCell:
        """Return one picture."""
        import torch

        from texgs.core.light import Light
        from texgs.metrics.quality import psnr
        from texgs.report.fit_figure import ERROR, signed_error
        from texgs.scene.changes import apply_all

        if not cell.show:
            return RenderedCell()
        session = self._session(cell.scene)
        try:
            apply_all(session, cell.changes)
            if cell.light:
                session.set_light(Light("directional", *cell.light))
            camera = self._camera(cell)
            scene = None if cell.show == "volume" else session.frame(camera).astype("float32") / 255
            volume = None if cell.show == "scene" else self._volume_frame(session, camera)
        finally:
            while session.undo():
                pass
        shown = [self._cut(image, cell) for image in (scene, volume) if image is not None]
        if len(shown) == 1:
            return RenderedCell(shown[0])
        image, truth = map(torch.from_numpy, shown)
        return RenderedCell(ERROR(signed_error(image, truth)).numpy(), psnr(image, truth))

    def _session(self, name: str) -> Session:
        from texgs.scene.scene_file import read_scene
        from texgs.scene.session import Session

        if self._open is None or self._open[0] != name:
            self._open, self._twin = (name, Session(read_scene(self._inputs[name]), self._device)), None
        return self._open[1]

    def _volume_frame(self, session: Session, camera: Camera) -> np.ndarray:
        from texgs.scene.twin import Twin

        self._twin = self._twin or Twin(session.scene, self._device)
        seen = self._twin.render(camera, session.scene, session.composition.palettes)
        return seen.color.cpu().clamp(0, 1).numpy()

    def _camera(self, cell: GalleryCell) -> Camera:
        """Return the camera of the whole view."""
        from texgs.core.camera import orbit

        size = cell.pixels or round(self._size / (cell.box[2] if cell.box else 1))
        azimuth, polar = cell.view
        lens = self._lens.square(size)
        return orbit(azimuth, polar, *lens._replace(fov_y=cell.fov_y or lens.fov_y))

    def _cut(self, image: np.ndarray, cell: GalleryCell) -> np.ndarray:
        """Return the part of a view that is shown, as large as a picture, each pixel that of its place."""
        import numpy as np

        left, top, side = cell.box or (0, 0, 1)
        across = (np.arange(self._size) + 0.5) / self._size * side * len(image)
        rows, columns = ((across + start * len(image)).astype(int) for start in (top, left))
        return image[rows[:, None], columns]


def applies(config: Config) -> bool:
    """Return whether this is the first of the recipes and variants of an experiment with scenes to show."""
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
    rule=Rule("gallery", "{dataset}/gallery/{gallery}", target="galleries", gpu=("fit",)),
    inputs=gallery_inputs,
    work=work,
    applies=applies,
)
