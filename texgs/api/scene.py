"""A scene in Python: pictures, films and files of what is edited, and what cells of notebooks show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING, Any

from texgs.api.display import MB, LivePage, Page, camera_of, picture_of
from texgs.api.editing import Editing
from texgs.core.check import torch_device
from texgs.core.cuts import NO_CUTS
from texgs.core.errors import ArgumentError
from texgs.core.names import EXPORTS, check_count, require_numbers
from texgs.core.progress import interrupts_between_items
from texgs.scene.copied import write_copy
from texgs.scene.frame import Mode
from texgs.scene.scene_file import known
from texgs.scene.session import Session

if TYPE_CHECKING:
    import pyvista
    from PIL.Image import Image

LARGEST_PAGE = 24.0  # MB of a page that a notebook gets by itself


class Scene(Editing):
    """Basic models with what is edited about them. At the end of a cell it is a page to orbit and edit.

    `scene["TF01"]` and `scene["TF01/part"]` are its parts; values that are set there count at once. Files of
    new looks and segments are kept as long as the object; `save` writes all that the scene needs. See
    `texgs.fit` and `texgs.open`.
    """

    __slots__ = ()

    # ---- Pictures and films ---------------------------------------------------

    def render(
        self,
        azimuth: float = 30.0,
        polar: float = 20.0,
        width: int = 800,
        height: int | None = None,
        *,
        mode: Mode = "shaded",
        fov_y: float = 30.0,
        radius: float | None = None,
        target: Sequence[float] | None = None,
        transparent: bool = False,
    ) -> Image:
        """Return a picture, which notebooks show; `numpy.asarray` of it is [H, W, 3], uint8.

        Args:
            azimuth: of the camera, degrees.
            polar: of the camera above the horizon, degrees.
            width: pixels.
            height: pixels; default the width.
            mode: shaded, volume, unshaded, normal, depth, alpha, texture, discs, or a factor of the material.
            fov_y: vertical field of view, degrees.
            radius: distance from the target, world units; default what shows all that is framed.
            target: that the camera looks at, world units; default the middle of what is framed.
            transparent: whether to leave the background out: [H, W, 4].
        """
        framed = self.session.scene.framed(self.session.composition)
        camera = camera_of(framed, azimuth, polar, width, height, fov_y, radius, target)
        return picture_of(self.session.frame(camera, mode, transparent=transparent))

    @interrupts_between_items()
    def film(
        self,
        path: str | Path,
        what: str = "orbit",
        *,
        frames: int | None = None,
        fps: float = 25.0,
        width: int = 800,
        height: int | None = None,
        azimuth: float = 30.0,
        polar: float = 20.0,
        mode: Mode = "shaded",
    ) -> Path:
        """Write a film, .mp4 or .gif, or a folder of pictures, and return its path.

        Args:
            path: of the film.
            what: moves: "orbit", "test" (the path of test views), "light", "cut" (the last plane), "time" or
                "orbit-time".
            frames: how many; default 72 where the camera turns, "test" 181, 61 for the others.
            fps: frames per second.
            width: pixels.
            height: pixels; default the width.
            azimuth: of the first frame, degrees.
            polar: degrees.
            mode: as for `render`.
        """
        from texgs.core.movie import write_frames
        from texgs.core.progress import progress
        from texgs.scene.paths import PATHS, shots_of

        if what not in PATHS:
            raise ArgumentError(f"what: expected one of {', '.join(PATHS)}, got {what}")
        scene, composed = self.session.scene, self.session.composition
        count = PATHS[what] if frames is None else frames
        check_count("frames", count)
        require_numbers(fps=fps)
        lens = scene.framed(composed).lens(width=width, height=width if height is None else height)
        shots = shots_of(scene, composed, what, count, lens, azimuth, polar)
        bar = progress(shots, count, title=Path(path).name, unit="frame")
        return write_frames(path, (self.session.frame(camera, mode, shown) for camera, shown in bar), fps)

    def psnr(self, views: int = 12, width: int = 400) -> float:
        """Return the mean PSNR in dB beside direct volume rendering, over views of the path of test views.

        Both have the scene's light and edits, without cuts. Looks and segments are not of the volume: they
        count as differences.
        """
        from texgs.metrics.quality import compare
        from texgs.volume.cameras import spiral

        check_count("views", views, least=2)
        scene = replace(self.session.scene, cuts=NO_CUTS)
        lens = scene.framed(self.session.composition).lens(width=width, height=width)
        pairs = (self.session.beside(camera, scene) for camera in spiral(views, lens, "views"))
        return fmean(compare(*pair)["psnr"] for pair in pairs)

    # ---- Files --------------------------------------------------------------

    def save(self, folder: str | Path) -> Path:
        """Write scene.yaml and copies of all files that it names into a folder; return the scene's file.

        Files of other names in the folder stay.
        """
        return write_copy(folder, self.session.scene)

    def export(self, path: str | Path, kind: str | None = None, **options: Any) -> Path:
        """Write a file for other programs, and return its path; see `texgs export --help`.

        Args:
            path: its ending says what: .html, .ply, .usdc, .usda, .glb, .spz, .vtp.
            kind: what, where an ending has several; default 3dgs for .ply.
            **options: of `texgs.scene.export.Export`; of .html, `steps`, see `show`, and `volume`, MB of the
                page for the volume.

        Raises:
            ArgumentError: if the ending is unknown or another kind's, an option is, or the scene cannot be
                written so.
        """
        from texgs.scene.export import OF_MODELS, Export, export_scene, taken
        from texgs.viewer.page_volume import page_volume
        from texgs.viewer.standalone import write_page

        path, scene = Path(path), self.session.scene
        able = {key: endings for key, endings in EXPORTS.items() if key not in OF_MODELS}
        if kind and kind not in able:
            raise ArgumentError(f"kind: expected one of {', '.join(able)}, got {kind}")
        chosen = kind or next((key for key, endings in able.items() if path.suffix in endings), "")
        if path.suffix not in able.get(chosen, ()):
            endings = dict.fromkeys(ending for each in able.values() for ending in each)
            expected = " or ".join(able.get(chosen, endings))
            raise ArgumentError(f"path: expected a file that ends in {expected}, got {path}")
        takes = ["steps", "volume"] if chosen == "html" else taken(chosen)
        known(options, takes, f"options of {chosen}")
        if chosen == "html":
            size = options.pop("volume", None)
            volume = None if size is None else page_volume(scene, size)
            write_page(path, scene, path.stem, volume=volume, **options)
            return path
        return export_scene(path, scene, Export(chosen, **options))

    # ---- Notebooks ------------------------------------------------------------

    def show(
        self, *, live: bool = False, largest: float = LARGEST_PAGE, steps: str | int = "all"
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
        from texgs.scene.joined import joined, polydata_of

        scene, composed = self.session.scene, self.session.composition
        if not isinstance(composed, Composition):
            raise ArgumentError("to_pyvista: expected a scene of surfels, got another kind; fit surfels")
        return polydata_of(joined(composed.parts, scene.edits), scene.space)

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
