"""Render many views of one volume into files; those already there are kept, so a killed run continues."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import torch
from numpy.typing import NDArray

from texgs.core.camera import Camera
from texgs.core.image import write_png
from texgs.core.io import read_json, write_json
from texgs.core.light import Light
from texgs.core.progress import progress
from texgs.volume.appearance import Appearance
from texgs.volume.transfer import TransferFunction
from texgs.volume.view_set import View


class Mapper(Protocol):
    """What renders a volume: `Caster` or `VtkMapper`."""

    local_viewer: bool  # whether directions to viewer and headlight differ from point to point

    def looking(self, appearance: Appearance) -> Mapper:
        """The same volume with another shading."""

    def render(self, tf: TransferFunction, camera: Camera, light: Light) -> NDArray[np.float32]:
        """Premultiplied RGBA [H, W, 4] in [0, 1]."""


class Times:
    """Times of all views, in a file that is written after each view, so that a killed run keeps them.

    Args:
        path: of the JSON file, in a folder above the views; what it says of earlier runs is kept.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._views: dict[str, dict[str, Any]] = read_json(path) if path.exists() else {}
        self._is_first = True

    def add(self, view: View, milliseconds: float) -> None:
        """Keep the time of a view, in place of an earlier one of the same view."""
        name = view.path.relative_to(self._path.parent).as_posix()
        self._views[name] = {"ms": milliseconds, "is_first": self._is_first}
        self._is_first = False
        write_json(self._path, self._views)

    @property
    def first(self) -> list[float]:
        """Milliseconds of the first view of each run, which sets up gradients and tables."""
        return [entry["ms"] for entry in self._views.values() if entry["is_first"]]

    @property
    def others(self) -> list[float]:
        """Milliseconds of all other views, in the order in which they were rendered."""
        return [entry["ms"] for entry in self._views.values() if not entry["is_first"]]


def render_views(
    mapper: Mapper, tf: TransferFunction, views: Sequence[View], title: str, times: Times | None = None
) -> None:
    """Render the views whose files are missing, as PNG with straight alpha.

    Args:
        mapper: the volume.
        tf: in data values.
        views: cameras, lights and files.
        title: of the progress bar.
        times: gets the time of each view that is rendered, without that of writing its file.
    """
    missing = [view for view in views if not view.path.exists()]
    for view in progress(missing, title=title, unit="view"):
        start = time.perf_counter()
        picture = mapper.render(tf, view.camera, view.light)
        seconds = time.perf_counter() - start
        if times is not None:
            times.add(view, 1e3 * seconds)  # before the image, which is not rendered again once it is there
        image = torch.from_numpy(np.ascontiguousarray(picture))
        write_png(view.path, image[..., :3], image[..., 3])
