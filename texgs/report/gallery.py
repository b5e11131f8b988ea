"""Pictures of scenes and their volumes in rows and columns, each with its own camera, light and changes."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from texgs.config.gallery import GalleryCell, Grid
from texgs.core.camera import Camera, orbit
from texgs.core.progress import progress
from texgs.metrics.quality import psnr
from texgs.report.fit_figure import ERROR, signed_error
from texgs.scene.changes import apply_all
from texgs.scene.scene_file import read_scene
from texgs.scene.session import Session
from texgs.scene.shot import Shot
from texgs.scene.twin import Twin


@dataclass(frozen=True, eq=False)
class RenderedCell:
    """A picture, or nothing."""

    pixels: np.ndarray | None = None  # [H, W, 3] in [0, 1]
    psnr: float | None = None  # against the volume, dB; for pictures of the difference


class GalleryRenderer:
    """Renders pictures; a scene stays open until a picture of another one.

    Args:
        scenes: their files by name; the first one frames all pictures.
        fov_y: vertical field of view of pictures that do not say another one, degrees.
        size: pixels of each side of a picture.
        device: that scenes and volumes are rendered on.
    """

    def __init__(self, scenes: Mapping[str, Path], fov_y: float, size: int, device: torch.device) -> None:
        self._lens = read_scene(next(iter(scenes.values()))).framed().lens(fov_y)
        self._scenes, self._size, self._device = scenes, size, device
        self._open: tuple[str, Session] | None = None
        self._twin: Twin | None = None  # of the open scene

    def render(self, cell: GalleryCell) -> RenderedCell:
        """Render one picture."""
        if not cell.show:
            return RenderedCell()
        session = self._session(cell.scene)
        try:
            apply_all(session, cell.changes)
            if cell.light:
                session.set_of_scene("light", cell.light)
            if cell.show == "error":
                session.set_of_scene("markers", ())
            camera = self._camera(cell)
            shot = Shot(legend=cell.legend and cell.show == "scene")
            scene = None if cell.show == "volume" else session.picture(camera, shot).astype("float32") / 255
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
        if self._open is None or self._open[0] != name:
            self._open, self._twin = (name, Session(read_scene(self._scenes[name]), self._device)), None
        return self._open[1]

    def _volume_frame(self, session: Session, camera: Camera) -> np.ndarray:
        self._twin = self._twin or Twin(session.scene, self._device)
        seen = self._twin.render(camera, session.scene, session.composition.palettes)
        return seen.color.cpu().clamp(0, 1).numpy()

    def _camera(self, cell: GalleryCell) -> Camera:
        """Return the camera of the whole view."""
        size = cell.pixels or round(self._size / (cell.box[2] if cell.box else 1))
        azimuth, polar = cell.view
        lens = self._lens.square(size)
        return orbit(azimuth, polar, *lens._replace(fov_y=cell.fov_y or lens.fov_y))

    def _cut(self, image: np.ndarray, cell: GalleryCell) -> np.ndarray:
        """Crop a view to the part to show, enlarged to picture size without interpolation."""
        left, top, side = cell.box or (0, 0, 1)
        across = (np.arange(self._size) + 0.5) / self._size * side * len(image)
        rows, columns = ((across + start * len(image)).astype(int) for start in (top, left))
        return image[rows[:, None], columns]


def render_rows(grid: Grid, renderer: GalleryRenderer, title: str) -> dict[str, list[RenderedCell]]:
    """Render the pictures of each row by its title, grouped by scene."""
    places = [(row.title, column, cell) for row in grid.rows for column, cell in enumerate(row.pictures)]
    places.sort(key=lambda place: place[2].scene)
    taken = {
        (row, column): renderer.render(cell)
        for row, column, cell in progress(places, title=title, unit="picture")
    }
    return {row.title: [taken[row.title, column] for column in range(len(row.pictures))] for row in grid.rows}
