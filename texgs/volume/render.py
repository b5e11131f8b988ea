"""Volume rendering behind one interface, and the views of a volume as files that are made only once."""

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Protocol, Self

import numpy as np
import torch
from numpy.typing import NDArray

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.image import write_png
from texgs.core.io import read_json, write_bytes
from texgs.core.light import Light
from texgs.core.names import is_number
from texgs.core.progress import progress
from texgs.volume.transfer import TransferFunction
from texgs.volume.view_set import View


@dataclass(frozen=True)
class Appearance:
    """How a volume looks besides its transfer function: Blinn-Phong factors, and sampling."""

    ambient: float = 0.3
    diffuse: float = 0.7
    specular: float = 0.3
    shininess: float = 20.0
    step: float = 0.25  # sample distance, voxels of the finest axis
    opacity_unit: float = 0.005  # length over which a transfer function's opacity applies, world units

    def __post_init__(self) -> None:
        for each in fields(self):
            value, is_length = getattr(self, each.name), each.name in ("step", "opacity_unit")
            if not is_number(value) or value < 0 or (is_length and value == 0):
                bound = "above 0" if is_length else "from 0"
                raise ArgumentError(f"{each.name}: expected a number {bound}, got {value!r:.100}")


class VolumeRenderer(Protocol):
    """What renders one volume from any camera: `Caster` or `VtkRenderer`."""

    local_viewer: bool  # whether directions to viewer and headlight differ from point to point

    def with_appearance(self, appearance: Appearance) -> Self:
        """Return a renderer of the same volume with another shading; nothing is read again."""

    def render(self, tf: TransferFunction, camera: Camera, light: Light) -> NDArray[np.float32]:
        """Return premultiplied RGBA [H, W, 4] in [0, 1], from a transfer function in data values."""


def directions(camera: Camera, light: Light) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return unit vectors [3] to the viewer and to the light: both are distant, the same for all points.

    A headlight shines along the optical axis.
    """
    to_viewer = -camera.viewmat.double().cpu().numpy()[2, :3]
    return to_viewer, to_viewer if light.kind == "headlight" else light.direction(camera).numpy()


class Times:
    """Times of all views in a JSON file above them, written after each, so that a killed run keeps them.

    The file is one line, which is many times as fast as `write_json`.
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
        write_bytes(self._path, json.dumps(self._views).encode())

    @property
    def first(self) -> list[float]:
        """Milliseconds of the first view of each run, which sets up gradients and tables."""
        return [entry["ms"] for entry in self._views.values() if entry["is_first"]]

    @property
    def others(self) -> list[float]:
        """Milliseconds of all other views, in the order in which they were rendered."""
        return [entry["ms"] for entry in self._views.values() if not entry["is_first"]]


def render_views(
    renderer: VolumeRenderer,
    tf: TransferFunction,
    views: Sequence[View],
    title: str,
    times: Times | None = None,
) -> None:
    """Render the views whose files are missing, as PNG with straight alpha; so a killed run continues.

    The title is that of the progress bar; `times` get the time of each view without writing its file.
    """
    missing = [view for view in views if not view.path.exists()]
    for view in progress(missing, title=title, unit="view"):
        start = time.perf_counter()
        picture = renderer.render(tf, view.camera, view.light)
        seconds = time.perf_counter() - start
        if times is not None:
            times.add(view, 1e3 * seconds)  # before the image, which is not rendered again once it is there
        image = torch.from_numpy(np.ascontiguousarray(picture))
        write_png(view.path, image[..., :3], image[..., 3])
