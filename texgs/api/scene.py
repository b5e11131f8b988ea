"""A scene in Python: pictures, films and files of what is edited, and what cells of notebooks show."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texgs.api.display import MB, LivePage, Page, picture_of
from texgs.api.editing import Editing
from texgs.api.keywords import takes
from texgs.core.check import torch_device
from texgs.core.cuts import NO_CUTS
from texgs.core.errors import ArgumentError
from texgs.core.names import check_count
from texgs.core.progress import interrupts_between_items
from texgs.scene.copied import write_copy
from texgs.scene.export_keys import Export
from texgs.scene.film import Film
from texgs.scene.session import Session
from texgs.scene.shot import Shot
from texgs.volume.slice_keys import SliceKeys

if TYPE_CHECKING:
    import pyvista
    from PIL.Image import Image

PAGE_MEGABYTES = 24.0  # at most, of a page that a notebook gets unasked


class Scene(Editing):
    """Basic models with what is edited about them. At the end of a cell it is a page to orbit and edit.

    `scene["TF01"]` and `scene["TF01/part"]` are its parts; values that are set there count at once. Files of
    new looks and segments are kept as long as the object; `save` writes all that the scene needs. See
    `texgs.fit` and `texgs.open`.
    """

    __slots__ = ()

    # ---- Pictures and films ---------------------------------------------------

    @takes(Shot, "azimuth", "polar", "width", "height")
    def render(self, shot: Shot) -> Image:
        """Return a picture, which notebooks show; `numpy.asarray` of it is [H, W, 3 or 4], uint8."""
        camera = shot.camera(self.session.scene.framed(self.session.composition))
        return picture_of(self.session.picture(camera, shot))

    @takes(SliceKeys, "plane", "number")
    def slice(self, keys: SliceKeys) -> Image:
        """Return a picture of a slice of the volume, or of all three, with labels and a crosshair."""
        return picture_of(self.session.slices(keys))

    @interrupts_between_items()
    @takes(Film, "what", what="orbit")
    def film(self, path: str | Path, film: Film) -> Path:
        """Write a film, .mp4 or .gif, or a folder of pictures, to a path, and return it."""
        shots = film.shots(self.session.scene, self.session.composition)
        return film.write(path, (self.session.picture(camera, film, scene) for camera, scene in shots))

    def psnr(self, views: int = 12, width: int = 400) -> float:
        """Return the mean PSNR in dB beside direct volume rendering, over views of the path of test views.

        Both have the scene's light and edits, without cuts. Looks and segments are not of the volume: they
        count as differences.
        """
        from texgs.report.compared import mean_scores
        from texgs.volume.cameras import spiral

        check_count("views", views, least=2)
        scene = replace(self.session.scene, cuts=NO_CUTS)
        lens = scene.framed(self.session.composition).lens(width=width, height=width)
        pairs = (self.session.beside(camera, scene) for camera in spiral(views, lens, "views"))
        return mean_scores(pairs)["psnr"]

    # ---- Files --------------------------------------------------------------

    def save(self, folder: str | Path) -> Path:
        """Write scene.yaml and copies of all files that it names into a folder; return the scene's file.

        Files of other names in the folder stay.
        """
        return write_copy(folder, self.session.scene)

    @takes(Export, "kind")
    def export(self, path: str | Path, keys: Export) -> Path:
        """Write a file for other programs, and return its path; its ending says what it is.

        Raises:
            ArgumentError: if the ending is unknown or another kind's, an option does not count for the kind,
                or the scene cannot be written so.
        """
        from texgs.viewer.export import export

        export(Path(path), self.session.scene, keys)
        return Path(path)

    # ---- Notebooks ------------------------------------------------------------

    def show(
        self, *, live: bool = False, largest: float = PAGE_MEGABYTES, steps: str | int = "all"
    ) -> Page | LivePage:
        """Return what a cell shows: a page that is part of the notebook; or the viewer, live.

        Args:
            live: show the viewer, on this machine, as long as this process runs: edits there are edits of
                this object, and the other way round.
            largest: MB of the page; of a larger one there is a picture.
            steps: of a series in time, that the page holds: "all", "one" or a number N, each N-th.
        """
        from texgs.viewer.standalone import scene_page

        if live:
            from texgs.api.live import Viewer

            self._viewer = self._viewer or Viewer(self.session, Path(self._scratch.name))
            return LivePage(self._viewer.address)
        page = scene_page(self.session.scene, ", ".join(self.session.scene.models), steps=steps)
        size, text = len(page.text.encode()) / MB, page.text
        note = f"{page.surfels:,} surfels; {size:.1f} MB of this notebook"
        if size > largest:
            text = ""
            note = f"A picture: the page has {size:.1f} MB. scene.show(largest={size:.0f}) shows it."
            note += ' scene.show(steps="one") has one step.' if page.steps and page.steps.size else ""
        return Page(text, page.poster, note)

    def _repr_mimebundle_(self, **_: Any) -> dict[str, Any]:
        """Return the page, for notebooks."""
        return self.show()._repr_mimebundle_()  # type: ignore[union-attr]

    def to_pyvista(self) -> pyvista.PolyData:
        """Return the visible surfels as polygons of PyVista; see `texgs.scene.joined.polydata_of`."""
        from texgs.fields.surfels.composition import Composition
        from texgs.scene.joined import join_surfels, polydata_of

        scene, composed = self.session.scene, self.session.composition
        if not isinstance(composed, Composition):
            raise ArgumentError("to_pyvista: expected a scene of surfels, got another kind; fit surfels")
        return polydata_of(join_surfels(composed.parts, scene.edits), scene.space)

    def __repr__(self) -> str:
        """Return the parts, and what is edited about them."""
        return "Scene\n" + "\n".join(f"  {self[name]!r}" for name in self)


def open_scene(path: str | Path, device: str = "cpu") -> Scene:
    """Return the scene of a path: scene.yaml, a folder with one in it or below, or a model file.

    Raises:
        ArgumentError: if there is no scene, or what it names is missing or damaged.
    """
    scene = Scene(Session.open(path, torch_device(device)))
    _ = scene.session.composition  # what is wrong with its files is told now
    return scene
