"""Further files of a folder of views: a turntable, depth and normals, and times of other renderers."""

import sys
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from statistics import median

import numpy as np
from PIL.Image import fromarray

from texgs.core.check import torch_device
from texgs.core.errors import DeviceError
from texgs.core.io import write_atomic
from texgs.core.lens import Lens
from texgs.core.light import HEADLIGHT
from texgs.core.progress import progress
from texgs.volume.cameras import orbit_path
from texgs.volume.caster import Caster
from texgs.volume.contact_sheet import write_animation
from texgs.volume.grid import Grid
from texgs.volume.render import Appearance, VolumeRenderer, render_views
from texgs.volume.transfer import TransferFunction
from texgs.volume.view_set import View

TURNTABLE = 320  # pixels of its longer side


def renderer_for(kind: str, grid: Grid, appearance: Appearance, tf: TransferFunction) -> VolumeRenderer:
    """Return the caster on the CPU or a GPU, or VTK, which knows one channel and no masks."""
    if kind == "vtk":
        from texgs.volume.vtk_renderer import VtkRenderer

        if tf.within is not None:
            raise DeviceError(
                "views.renderer: expected cpu or gpu for a function within a label, got vtk; choose another"
            )
        return VtkRenderer(grid.channel(tf.channel), appearance)
    return Caster(grid, appearance, torch_device("cuda" if kind == "gpu" else "cpu"))


def vtk_frame_ms(
    grid: Grid, appearance: Appearance, tf: TransferFunction, shot: Sequence[View], title: str
) -> float | None:
    """Return the median milliseconds of views rendered by VTK, or None if it cannot render offscreen."""
    try:
        vtk = renderer_for("vtk", grid, appearance, tf)
    except DeviceError as error:
        print(f"{title}: VTK's time is not measured: {error}", file=sys.stderr)
        return None
    frames = []
    for view in progress([shot[0], *shot], title=f"{title}: views by VTK", unit="view"):
        start = time.perf_counter()
        vtk.render(tf, view.camera, view.light)
        frames.append(1e3 * (time.perf_counter() - start))
    return median(frames[1:])  # the first one uploads the volume


def turntable(
    renderer: VolumeRenderer, tf: TransferFunction, count: int, lens: Lens, output: Path, title: str
) -> None:
    """Write turntable.png, an animation of one turn under a headlight of so many frames."""
    scale = min(1.0, TURNTABLE / max(lens.width, lens.height))
    width, height = (max(1, round(scale * size)) for size in (lens.width, lens.height))
    around = orbit_path(count, 15.0, lens._replace(width=width, height=height))
    shot = [
        View(camera, output / "turntable" / f"r_{index:04}.png", HEADLIGHT)
        for index, camera in enumerate(around)
    ]
    render_views(renderer, tf, shot, f"{title}: turntable")
    write_animation(output / "turntable.png", [fromarray(view.load().numpy()) for view in shot])


def write_geometry(caster: Caster, tf: TransferFunction, shot: list[View], folder: Path, title: str) -> None:
    """Write depth and normals of views as .npz, the arrays `depth` [H, W] and `normal` [H, W, 3]."""
    for view in progress(shot, title=f"{title}: depth and normals", unit="view"):
        path = folder / f"{view.path.stem}.npz"
        if path.exists():
            continue
        seen = caster.cast(tf, view.camera, view.light, ("depth", "normal"))
        planes = {"depth": seen.depth, "normal": seen.normal}
        arrays = {name: x.cpu().numpy() for name, x in planes.items() if x is not None}
        write = partial(
            np.savez_compressed, depth=arrays["depth"], normal=arrays["normal"].astype(np.float16)
        )
        write_atomic(path, write)
