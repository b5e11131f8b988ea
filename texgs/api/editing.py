"""Edits of a scene from Python: values of parts, light, looks, segments. Each can be undone."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import torch

from texgs.api.display import picture_of
from texgs.api.part import Part, Value
from texgs.core.errors import ArgumentError
from texgs.core.light import Light
from texgs.core.markers import Marker
from texgs.core.names import new_part_file
from texgs.core.progress import interrupts_between_items
from texgs.scene.changes import apply_all, new_marker
from texgs.scene.parts import part_names
from texgs.scene.session import Session
from texgs.scene.shot import Shot

if TYPE_CHECKING:
    from PIL.Image import Image

    from texgs.api.live import Viewer

PNG_MODES = ("1", "L", "LA", "P", "RGB", "RGBA", "I", "I;16")  # of pictures that PNG holds


class Editing:
    """A scene with the history of its edits.

    Args:
        session: the scene and its history.
        kept: what has to stay as long as the scene, such as folders of its files.
    """

    __slots__ = ("__weakref__", "_count", "_kept", "_scratch", "_viewer", "session")  # a slip is an error

    _part = ""  # none: values are of the whole scene
    light = Value[Light](
        'Light: set "headlight", or azimuth and polar angle in degrees; shadows and occlusion stay, '
        "unless it is a Light."
    )
    shadows = Value[float](
        "Share of a directional light that matter in its way takes away: set 0, none, to 1.", of="light"
    )
    occlusion = Value[float](
        "Share of ambient light that matter around takes away: set 0, none, to 1.", of="light"
    )
    reach = Value[float]("How far matter is that hides ambient light: set world units up to 2.", of="light")
    background = Value["tuple[float, float, float]"](
        'Colour behind the scene: set red, green, blue from 0 to 1, "#rrggbb" or a name.'
    )
    markers = Value[tuple[Marker, ...]]("Points and distances in world units, see `mark`; None: none.")
    time = Value["int | None"]("Number of the step that is shown, of a scene of a series; None of others.")

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
        return Part(self.session, str(name))

    def __iter__(self) -> Iterator[str]:
        """Yield the names of all parts."""
        return iter(self.parts)

    def __len__(self) -> int:
        """Return the number of parts."""
        return len(self.parts)

    def edit(self, *words: str) -> Self:
        """Make the changes that words ask for, as `texgs edit` has them, such as "cut=x,0.1"; return self.

        They are one step. Where a word is wrong, none of them counts.
        """
        if not all(isinstance(word, str) for word in words):
            raise ArgumentError(f"words: expected text such as 'light=30,40', got {words!r:.100}")
        with self.session.one_step(" ".join(words)):
            apply_all(self.session, words)
        return self

    def mark(self, *places: Sequence[float], text: str = "") -> Self:
        """Mark a place in the space and unit of the volume's file, or the distance of two; return self."""
        with self.session.one_step(f"marker {text}"):
            marker = new_marker(self.session.scene, places, text)
            self.session.set_of_scene("markers", [*self.markers, marker])
        return self

    def undo(self) -> bool:
        """Take the latest change back; return whether there was one."""
        return self.session.undo()

    def redo(self) -> bool:
        """Make again what was undone last; return whether there was anything."""
        return self.session.redo()

    # ---- Looks and segments -------------------------------------------------

    def style(
        self, picture: str | Path | Image | np.ndarray, parts: Sequence[str] = (), **settings: Any
    ) -> Self:
        """Give parts the style of a picture, and return self; their palettes go back to the fitted ones.

        Args:
            picture: a picture that texgs paints (strokes, glass, ...), a file, or an image.
            parts: names of parts; default all models, whose segments stay as they are.
            **settings: keys of `edit.image` such as `recipe="preview"` or `pattern=0.5`; recipe `patches`
                needs no weights of VGG-16.

        Raises:
            ArgumentError: for unknown keys or values, a picture that cannot be read, or missing weights.
        """
        return self._look("image", {"style": self._picture(picture), **settings}, parts)

    def instruct(self, instruction: str, parts: Sequence[str] = (), **settings: Any) -> Self:
        """Change the look of parts by an instruction such as "make it gold", and return self.

        Their palettes go back to the fitted ones.

        Args:
            instruction: for InstructPix2Pix; or, with `guidance="filters"`, of words that filters know.
            parts: names of parts; default all models, whose segments stay as they are.
            **settings: keys of `edit.text`.

        Raises:
            ArgumentError: for unknown keys, values or words, or missing weights.
        """
        if not isinstance(instruction, str):
            raise ArgumentError(f"instruction: expected text, got {instruction!r:.100}")
        return self._look("text", {"instruction": instruction, **settings}, parts)

    @interrupts_between_items()
    def segment(
        self,
        name: str,
        point: Sequence[float] | Sequence[Sequence[float]],
        *,
        model: str | None = None,
        azimuth: float | None = None,
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
            azimuth: of that picture's camera, degrees; default as for `render`.
            polar: of that picture's camera, degrees.
            size: of that picture, pixels.
            masks: what finds the object in pictures; "grabcut" needs no weights.
            views: number of views that vote on surfels, 10 f^2 + 2.

        Raises:
            ArgumentError: if the name is taken, no surfel is there, or weights are missing.
        """
        from texgs.edit.clicks import Clicks
        from texgs.edit.mask_keys import MaskKeys
        from texgs.edit.new_segment import model_name, new_segment

        scene, device = self.session.scene, self.session.composition.device
        part, framed = f"{model_name(scene, model, 'model')}/{name}", scene.framed(self.session.composition)
        try:
            pixels = torch.tensor(point, dtype=torch.float32, device=device).reshape(-1, 2) + 0.5
        except (TypeError, ValueError, RuntimeError) as error:
            raise ArgumentError(f"point: expected pixel x, y, or several, got {point!r:.100}") from error
        azimuth = framed.azimuth if azimuth is None else azimuth
        camera = Shot(size, azimuth=azimuth, polar=polar).camera(framed).to(device)
        clicks = Clicks(camera, pixels, torch.ones(len(pixels), dtype=torch.bool, device=device))
        keys, facts = MaskKeys(masks, views=views), {"view": [azimuth, polar], "point": pixels.tolist()}
        file, title = partial(self._new_file, "segment", part), f"segment {name}"
        new_segment(self.session, part, clicks, keys, framed.lens(), file, facts, title=title)
        return self[part]

    @interrupts_between_items()
    def _look(self, method: str, values: dict[str, Any], parts: Sequence[str]) -> Self:
        """Give parts a new look by a method of editing with values of its settings."""
        from texgs.edit.new_look import give_look, look_task, settings_of

        if isinstance(parts, str) or not isinstance(parts, Iterable):
            parts = [str(parts)]
        scene, device = self.session.scene, self.session.composition.device
        task = look_task(scene, settings_of(method, values), parts, self._new_folder(method), device)
        give_look(self.session, task, str(next(iter(values.values()))))
        return self

    def _picture(self, picture: Any) -> str:
        """Return the name or the file of a picture."""
        if isinstance(picture, str | Path):
            return str(picture)
        image = picture if hasattr(picture, "save") else self._painted(picture)
        file = self._new_folder("picture") / "style.png"
        file.parent.mkdir()
        (image if image.mode in PNG_MODES else image.convert("RGB")).save(file)
        return str(file)

    @staticmethod
    def _painted(pixels: Any) -> Image:
        """Return an array as a picture."""
        values = np.asarray(pixels)
        if values.dtype != np.uint8 or values.ndim != 3 or values.shape[2] not in (3, 4):
            expected = "a name, a file, a picture of Pillow or an array [H, W, 3] of uint8"
            raise ArgumentError(f"picture: expected {expected}, got {list(values.shape)} of {values.dtype}")
        return picture_of(values)

    def _new_folder(self, kind: str) -> Path:
        """Return a free path for a folder of the scene's files."""
        self._count += 1
        return Path(self._scratch.name, f"{self._count}-{kind}")

    def _new_file(self, kind: str, part: str) -> Path:
        """Return a free path for the file of a new part."""
        return new_part_file("name", Path(self._scratch.name), kind, part)
