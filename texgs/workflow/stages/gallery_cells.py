"""Pictures of a scene or of its volume: from where, under which light, with which changes, and which part."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from texgs.workflow.stages.settings import OfScene

if TYPE_CHECKING:
    import numpy as np

    from texgs.core.camera import Camera
    from texgs.scene.session import Session


@dataclass
class GalleryCell:
    """What the configuration says of one picture, see `texgs.config.gallery`."""

    scene: str  # its name among the inputs
    show: str  # scene, volume, error, or "" for nothing
    view: list[float]
    fov_y: float | None
    box: list[float]
    pixels: int | None
    light: list[float]
    changes: list[str]


@dataclass(frozen=True, eq=False)
class RenderedCell:
    """A picture, or nothing."""

    pixels: np.ndarray | None = None  # [H, W, 3] in [0, 1]
    psnr: float | None = None  # against the volume, where the picture shows the difference, dB


class GalleryRenderer:
    """Takes pictures. A scene stays open until one of another is taken.

    Args:
        settings: of a job that shows scenes and their volume.
        inputs: scene files by name, and `volume` where one is shown.
        size: pixels of each side of a picture.
    """

    def __init__(self, settings: OfScene, inputs: Mapping[str, Path], size: int) -> None:
        from texgs.core.check import torch_device
        from texgs.workflow.stages.volume_scene import VolumeScene

        self._device, self._lens = torch_device(settings.fit.device), settings.views.lens
        self._inputs, self._size = inputs, size
        self._volume = VolumeScene(settings, inputs["volume"]) if "volume" in inputs else None
        self._open: tuple[str, Session] | None = None

    def render(self, cell: GalleryCell) -> RenderedCell:
        """Return one picture."""
        import torch

        from texgs.core.light import Light
        from texgs.metrics.image import psnr
        from texgs.report.fit_figure import ERROR, signed_error
        from texgs.scene.changes import apply_all

        if not cell.show:
            return RenderedCell()
        session = self._session(cell.scene)
        try:
            apply_all(session, cell.changes)
            if cell.light:
                session.set_light(Light("directional", *cell.light))
            scene = self._frame(session, cell) if cell.show != "volume" else None
            volume = self._volume_frame(session, cell) if cell.show != "scene" else None
        finally:
            while session.undo():
                pass
        if scene is None or volume is None:
            return RenderedCell(volume if scene is None else scene)
        image, truth = torch.from_numpy(scene), torch.from_numpy(volume)
        return RenderedCell(ERROR(signed_error(image, truth)).numpy(), psnr(image, truth))

    def _session(self, name: str) -> Session:
        from texgs.scene.scene_file import read_scene
        from texgs.scene.session import Session

        if self._open is None or self._open[0] != name:
            self._open = (name, Session(read_scene(self._inputs[name]), self._device))
        return self._open[1]

    def _frame(self, session: Session, cell: GalleryCell) -> np.ndarray:
        return self._cut(session.frame(self._camera(cell)), cell).astype("float32") / 255

    def _volume_frame(self, session: Session, cell: GalleryCell) -> np.ndarray:
        import numpy as np

        assert self._volume is not None, "an input where a place shows it"
        scene = session.scene
        rgba = self._volume.render(self._camera(cell), scene, session.composition.palettes)
        color = rgba[..., :3] + (1 - rgba[..., 3:]) * np.asarray(scene.background, dtype="float32")
        return self._cut(color.clip(0, 1), cell)

    def _camera(self, cell: GalleryCell) -> Camera:
        """Return the camera of the whole view."""
        from texgs.core.camera import orbit

        size = cell.pixels or round(self._size / (cell.box[2] if cell.box else 1))
        azimuth, polar = cell.view
        return orbit(azimuth, polar, self._lens.radius, cell.fov_y or self._lens.fov_y, size, size)

    def _cut(self, image: np.ndarray, cell: GalleryCell) -> np.ndarray:
        """Return the part of a view that is shown, as large as a picture, each pixel that of its place."""
        import numpy as np

        left, top, side = cell.box or (0, 0, 1)
        across = (np.arange(self._size) + 0.5) / self._size * side * len(image)
        rows, columns = ((across + start * len(image)).astype(int) for start in (top, left))
        return image[rows[:, None], columns]
