"""Render many views of one volume into files; those already there are kept, so a killed run goes on."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import torch
from numpy.typing import NDArray

from texgs.core.camera import Camera
from texgs.core.image import write_png
from texgs.core.progress import progress
from texgs.volume.transfer import TransferFunction
from texgs.volume.view_set import Light, View


class Mapper(Protocol):
    """What renders a volume: `CpuMapper` or `GpuMapper`."""

    local_viewer: bool  # whether directions to viewer and headlight differ from point to point

    def render(self, tf: TransferFunction, camera: Camera, light: Light) -> NDArray[np.float32]:
        """Premultiplied RGBA [H, W, 4] in [0, 1]."""


@dataclass(frozen=True)
class Frame:
    """One view that was rendered now."""

    milliseconds: float  # of rendering, without writing the file
    coverage: float  # share of pixels that show something


def render_views(mapper: Mapper, tf: TransferFunction, views: Sequence[View], title: str) -> list[Frame]:
    """Render the views whose files are missing, as PNG with straight alpha.

    Args:
        mapper: the volume.
        tf: in data values.
        views: cameras, lights and files.
        title: of the progress bar.

    Returns:
        One entry per view that was rendered, in their order.
    """
    missing = [view for view in views if not view.path.exists()]
    frames = []
    for view in progress(missing, title=title, unit="view"):
        start = time.perf_counter()
        picture = mapper.render(tf, view.camera, view.light)
        seconds = time.perf_counter() - start
        image = torch.from_numpy(np.ascontiguousarray(picture))
        write_png(view.path, image[..., :3], image[..., 3])
        frames.append(Frame(1e3 * seconds, float((image[..., 3] > 0.5 / 255).float().mean())))
    return frames
