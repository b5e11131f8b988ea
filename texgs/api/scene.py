"""A scene that Python edits: parts, light, looks, segments; pictures, films and files of it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import fmean
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import torch

from texgs.api.display import LivePage, Page, as_light, camera_of, picture_of
from texgs.api.part import Part
from texgs.core.errors import ArgumentError
from texgs.core.keys import ValueMismatch, typed
from texgs.core.light import Light
from texgs.core.names import EXPORTS, part_file
from texgs.scene.changes import apply_all
from texgs.scene.copied import write_copy
from texgs.scene.frame import Mode
from texgs.scene.parts import part_names
from texgs.scene.session import Session

if TYPE_CHECKING:
    import numpy as np
    import pyvista
    from PIL.Image import Image

    from texgs.api.live import Viewer

LARGEST_PAGE = 24.0  # MB of a page that a notebook gets by itself
VOTING = 512  # pixels of views that vote on the surfels of a segment


class Scene:
    """Basic models with what is edited about them. At the end of a cell it is a page to orbit and edit.

    `scene["TF01"]` and `scene["TF01/part"]` are its parts; values that are set there count at once. Files of
    new looks and segments are kept as long as the object; `save` writes all that the scene needs.

    Args:
        session: the scene and its history; see `texgs.fit` and `texgs.open`.
        kept: what has to stay as long as the scene, such as folders of its files.
    """

    def __init__(self, session: Session, *kept: Any) -> None:
        self.session = session
        self._scratch = TemporaryDirectory(prefix="texgs-")
        self._kept, self._count = kept, 0
        self._viewer: Viewer | None = None

    # ---- Parts and edits ----------------------------------------------------

    @property
    def parts(self) -> list[str]:
        """Return the names of all models and their segments."""
        return part_names(self.session.scene)

    def __getitem__(self, name: str) -> Part:
        """Return a part; another name is an ArgumentError that lists those that there are."""
        return Part(self, name)

    def __iter__(self) -> Iterator[str]:
        """Yield the names of all parts."""
        return iter(self.parts)

    def __len__(self) -> int:
        """Return the number of parts."""
        return len(self.parts)

    @property
    def light(self) -> Light:
        """The light: set "headlight", or azimuth and polar angle in degrees."""
        return self.session.scene.light

    @light.setter
    def light(self, value: Light | str | Sequence[float]) -> None:
        self.session.set_light(as_light(value))
        self.changed(f"light {value}")

    @property
    def background(self) -> tuple[float, float, float]:
        """The colour behind the scene: set red, green, blue from 0 to 1, or "#rrggbb"."""
        return self.session.scene.background

    @background.setter
    def background(self, value: str | Sequence[float]) -> None:
        self.session.set_background(value)
        self.changed(f"background {value}")

    @property
    def time(self) -> int | None:
        """The number of the step that is shown, of a scene of a series; None of others."""
        return self.session.scene.time

    @time.setter
    def time(self, step: int) -> None:
        self.session.set_of_scene("time", step)
        self.changed(f"time {step}")

    def edit(self, *words: str) -> Scene:
        """Make the changes that words ask for, as `texgs edit` has them, such as "cut=x,0.1"; return self."""
        apply_all(self.session, words)
        return self.changed(" ".join(words))

    def undo(self) -> bool:
        """Take the latest change back; return whether there was one."""
        done = self.session.undo()
        self.changed()
        return done

    def redo(self) -> bool:
        """Make again what was undone last; return whether there was anything."""
        done = self.session.redo()
        self.changed()
        return done

    def changed(self, title: str = "") -> Scene:
        """Give the latest step a title, and tell pages of the viewer that show this scene; return self."""
        if title:
            self.session.name_step(title)
        if self._viewer is not None:
            self._viewer.tell()
        return self

    # ---- Looks and segments -------------------------------------------------

    def style(
        self, picture: str | Path | Image | np.ndarray, parts: Sequence[str] = (), **settings: Any
    ) -> Scene:
        """Give parts the style of a picture, and return self.

        Args:
            picture: a picture that texgs paints (strokes, glass, ...), a file, or an image.
            parts: names of parts; default all.
            **settings: keys of `edit.image` such as `recipe="preview"` or `pattern=0.5`; recipe `patches`
                needs no weights of VGG-16.

        Raises:
            ArgumentError: for unknown keys or values, a picture that cannot be read, or missing weights.
        """
        return self._look("image", {"style": self._picture(picture), **settings}, parts)

    def instruct(self, instruction: str, parts: Sequence[str] = (), **settings: Any) -> Scene:
        """Change the look of parts by an instruction such as "make it gold", and return self.

        Args:
            instruction: for InstructPix2Pix; or, with `guidance="filters"`, of words that filters know.
            parts: names of parts; default all.
            **settings: keys of `edit.text`.

        Raises:
            ArgumentError: for unknown keys, values or words, or missing weights.
        """
        return self._look("text", {"instruction": instruction, **settings}, parts)

    def segment(
        self,
        name: str,
        point: Sequence[float] | Sequence[Sequence[float]],
        *,
        model: str | None = None,
        azimuth: float = 30.0,
        polar: float = 20.0,
        size: int = 800,
        masks: str = "mobile_sam",
        views: int = 42,
    ) -> Part:
        """Make what a click on one model is on a part of its own, and return it.

        Args:
            name: of the segment.
            point: pixel x, y, or several, in a square picture of the model alone from there.
            model: name; may be left out where there is one.
            azimuth: of that picture's camera, degrees.
            polar: of that picture's camera, degrees.
            size: of that picture, pixels.
            masks: what finds the object in pictures; "grabcut" needs no weights.
            views: number of views that vote on surfels, 10 f^2 + 2.

        Raises:
            ArgumentError: if the name is taken, no surfel is there, or weights are missing.
        """
        from texgs.edit.clicks import Clicks
        from texgs.edit.new_segment import model_name, new_segment
        from texgs.models.sam import mask_model
        from texgs.volume.cameras import icosphere_of

        scene, device = self.session.scene, self.session.composition.device
        part = f"{model_name(scene, model, 'model')}/{name}"
        framed = scene.framed(self.session.composition)
        pixels = torch.tensor(point, dtype=torch.float32, device=device).reshape(-1, 2) + 0.5
        every = torch.ones(len(pixels), dtype=torch.bool, device=device)
        clicks = Clicks(camera_of(framed, azimuth, polar, size).to(device), pixels, every)
        around = [each.to(device) for each in icosphere_of(views, framed.lens().square(VOTING))]
        file = self._new_folder("segment") / part_file("name", part)
        facts = {"view": [azimuth, polar], "point": pixels.tolist(), "masks": masks}
        made = new_segment(
            scene, part, clicks, around, mask_model(masks, device), file, facts, title=f"segment {name}"
        )
        self.session.set_scene(made.scene)
        self.changed(f"{part} new")
        return self[part]

    def _look(self, method: str, values: dict[str, Any], parts: Sequence[str]) -> Scene:
        """Give parts a new look by a method of editing with values of its settings."""
        from texgs.config.recipes import Edit
        from texgs.edit.method import method_of
        from texgs.edit.orbit_task import orbit_task
        from texgs.edit.task import parts_of
        from texgs.scene.parts import look_of

        before, device = self.session.scene, self.session.composition.device
        try:
            edit = typed(Edit, {"name": method, "method": method, "parts": [*parts], method: values})
        except ValueMismatch as error:
            raise ArgumentError(str(error)) from error
        method_of(edit).of(edit).check()
        task = replace(orbit_task(before, edit, self._new_folder(method), device), draws=False)
        after = method_of(edit).run(task).scene
        names = parts_of(before, edit.parts)
        self.session.set_looks({name: look_of(after, name, before) for name in names})
        return self.changed(f"{', '.join(names)} {next(iter(values.values()))}")

    def _picture(self, picture: Any) -> str:
        """Return the name or the file of a picture."""
        if isinstance(picture, str | Path):
            return str(picture)
        image = picture if hasattr(picture, "save") else picture_of(picture)
        file = self._new_folder("picture") / "style.png"
        image.save(file)
        return str(file)

    def _new_folder(self, kind: str) -> Path:
        """Return a new folder for files of the scene."""
        self._count += 1
        folder = Path(self._scratch.name, f"{self._count}-{kind}")
        folder.mkdir()
        return folder

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
        lens = scene.framed(composed).lens(width=width, height=width if height is None else height)
        shots = shots_of(scene, composed, what, count, lens, azimuth, polar)
        bar = progress(shots, count, title=Path(path).name, unit="frame")
        return write_frames(path, (self.session.frame(camera, mode, shown) for camera, shown in bar), fps)

    def psnr(self, views: int = 12, width: int = 400) -> float:
        """Return the mean PSNR in dB beside direct volume rendering, over views of the path of test views.

        Both have the scene's light and edits. Looks and segments are not of the volume: they count as
        differences.
        """
        from texgs.metrics.quality import compare
        from texgs.volume.cameras import spiral

        scene = self.session.scene
        lens = scene.framed(self.session.composition).lens(width=width, height=width)
        pairs = (self.session.beside(camera, scene) for camera in spiral(views, *lens))
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
            **options: of `texgs.scene.export.Export`.

        Raises:
            ArgumentError: if the ending is unknown or another kind's, or the scene cannot be written so.
        """
        from texgs.scene.export import OF_MODELS, Export, export_scene
        from texgs.viewer.standalone import write_page

        path, scene = Path(path), self.session.scene
        able = {key: endings for key, endings in EXPORTS.items() if key not in OF_MODELS}
        chosen = kind or next((key for key, endings in able.items() if path.suffix in endings), "")
        if path.suffix not in able.get(chosen, ()):
            endings = dict.fromkeys(ending for each in able.values() for ending in each)
            expected = " or ".join(able.get(chosen, endings))
            raise ArgumentError(f"path: expected a file that ends in {expected}, got {path}")
        if chosen == "html":
            write_page(path, scene, path.stem)
            return path
        return export_scene(path, scene, Export(chosen, **options))

    # ---- Notebooks ------------------------------------------------------------

    def show(self, *, live: bool = False, largest: float = LARGEST_PAGE) -> Page | LivePage:
        """Return what a cell shows: a page that is part of the notebook; or the viewer, live.

        Args:
            live: show the viewer, on this machine, as long as this process runs: edits there are edits of
                this object, and the other way round.
            largest: MB of the page; of a larger one there is a picture.
        """
        from texgs.api.display import MB
        from texgs.viewer.standalone import scene_page

        if live:
            from texgs.api.live import Viewer

            self._viewer = self._viewer or Viewer(self.session, Path(self._scratch.name))
            return LivePage(self._viewer.address)
        page = scene_page(self.session.scene, ", ".join(self.session.scene.models))
        size, text = len(page.text.encode()) / MB, page.text
        note = f"{page.surfels:,} surfels; {size:.1f} MB of this notebook"
        if size > largest:
            text = ""
            note = f"A picture: the page has {size:.1f} MB. scene.show(largest={size:.0f}) shows it."
        return Page(text, page.poster, note)

    def _repr_mimebundle_(self, **_: Any) -> dict[str, Any]:
        """Return the page, for notebooks."""
        return self.show()._repr_mimebundle_()  # type: ignore[union-attr]

    def to_pyvista(self) -> pyvista.PolyData:
        """Return the visible surfels as polygons of PyVista; see `texgs.scene.polydata.polydata_of`."""
        from texgs.fields.surfels.composition import Composition
        from texgs.scene.joined import joined
        from texgs.scene.polydata import polydata_of

        scene, composed = self.session.scene, self.session.composition
        if not isinstance(composed, Composition):
            raise ArgumentError("to_pyvista: expected a scene of surfels, got another kind; fit surfels")
        return polydata_of(joined(composed.parts, scene.edits), scene.volume)

    def __repr__(self) -> str:
        """Return the parts, and what is edited about them."""
        return "Scene\n" + "\n".join(f"  {self[name]!r}" for name in self)


def open_scene(path: str | Path, device: str = "cpu") -> Scene:
    """Return the scene of a path: scene.yaml, a folder with one in it or below, or a model file.

    Raises:
        ArgumentError: if there is no scene, or what it names is missing or damaged.
    """
    from texgs.viewer.shared_edits import open_scene as opened

    scene = Scene(Session(opened(Path(path)).scene, device))
    _ = scene.session.composition  # what is wrong with its files is told now
    return scene
