"""How close shadows and occlusion of a grid are to rays to the light, and how many directions the sky takes.

`python -m benchmarks.light OUTPUT.csv DATASET...` makes volumes and looks at all basic functions of each at
once. Rows have means over lights and cameras: PSNR of pictures and of their pixels where anything is
seen, and of the openness where surfaces look it up, itself and its errors in 255ths.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
import torch
from torch import Tensor

from benchmarks.command import call
from tests.volume.light_rays import LightRays
from tests.volume.march import march
from tests.volume.scenes import psnr
from texgs.cli.main import main as texgs
from texgs.config.compose import compose
from texgs.core.camera import Camera, orbit
from texgs.core.lens import Frame
from texgs.core.light import Light, random_lights
from texgs.raster import native
from texgs.volume.basic_tfs import basic_tfs_of
from texgs.volume.caster import Caster
from texgs.volume.framing import frame_of
from texgs.volume.grid import Grid
from texgs.volume.light_cells import LightCells, NativeCells
from texgs.volume.matter import Matter, even_directions
from texgs.volume.nrrd_file import open_grid
from texgs.volume.overlay import overlays
from texgs.volume.render import Appearance
from texgs.volume.transfer import TransferFunction
from texgs.workflow.stage import result_file

SIZE, VIEWS, SEED = 64, 2, 0  # pixels of either side; cameras with a light each
CELLS = (128, 64, 32)  # along the longest side
DIRECTIONS, MOST = (8, 16, 32, 64, 128), 1024
REACHES = (0.125, 0.25, 0.5)  # world units
SEEN, SOLID = 0.02, 0.5  # least alpha of pixels where anything is seen, and of those with a surface


class Looked(NamedTuple):
    """A volume as a data set shows it."""

    grid: Grid
    tfs: Sequence[TransferFunction]
    look: Appearance
    frame: Frame

    def cameras(self, size: int) -> Iterator[tuple[Camera, Light]]:
        """Yield cameras with lights that cast shadows."""
        for light in random_lights(VIEWS, SEED):
            camera = orbit(light.azimuth + 60, 25, *self.frame.lens(width=size, height=size))
            yield camera, Light("directional", light.azimuth, light.polar, shadows=1.0)


def main(output: str, *datasets: str) -> None:
    """Measure, print and write a row for each data set, measure and choice."""
    tables = {name: measured(looked(name)) for name in datasets}
    table = pd.concat(tables, names=["data set"]).reset_index(level=0)
    print(table.round(2).to_string(index=False))
    table.round(3).to_csv(output, index=False, lineterminator="\n")


def looked(dataset: str) -> Looked:
    """Make the volume of a data set and read it with its basic functions."""
    words = (f"dataset={dataset}",)
    texgs(["volume", *words])
    config = compose(words)
    file = result_file("volume", config)
    functions = basic_tfs_of(file, config.dataset.basic_tfs, config.dataset.tf_values)
    look = Appearance(step=config.views.step, opacity_unit=config.views.opacity_unit)
    grid = open_grid(file)
    return Looked(grid, overlays(functions), look, frame_of(grid, functions.values()))


def measured(volume: Looked, size: int = SIZE) -> pd.DataFrame:
    """Return the rows of one volume: measure, choice, and the mean of each number."""
    rows = [
        row for view in volume.cameras(size) for row in (*shadows(volume, *view), *openness(volume, *view))
    ]
    return pd.DataFrame(rows).groupby(["measure", "choice"], sort=False).mean().reset_index()


def shadows(volume: Looked, camera: Camera, light: Light) -> Iterator[dict[str, object]]:
    """Yield the PSNR of shadows by cells, of several numbers, against rays from the same places."""
    caster = Caster(volume.grid, volume.look)
    rays = LightRays(volume.grid, volume.tfs, volume.look.opacity_unit)
    for longest in CELLS:
        matter = Matter(caster, volume.tfs, volume.look.opacity_unit, longest=longest)
        cells = matter.lit(light.direction(camera), None)
        seen = caster.cast(volume.tfs, camera, light, cells=cells).rgba
        exposure = rays.exposure(light, even_directions(1), cells.outset)
        expected = march(volume.grid, volume.tfs, camera, volume.look, light, exposure)
        unhidden = caster.cast(volume.tfs, camera, light.unhidden).rgba
        yield {"measure": "cells", "choice": longest, **decibels(seen, expected.color, expected.alpha)}
        yield {
            "measure": "no shadows",
            "choice": longest,
            **decibels(unhidden, expected.color, expected.alpha),
        }


def decibels(rgba: Tensor, color: Tensor, alpha: Tensor) -> dict[str, float]:
    """Return the PSNR of a picture, and of its pixels where anything is seen."""
    is_seen = alpha > SEEN
    pair = rgba[..., :3].numpy(), color.numpy()
    return {"PSNR": psnr(*pair), "PSNR of what is seen": psnr(*(each[is_seen.numpy()] for each in pair))}


def openness(volume: Looked, camera: Camera, _: Light) -> Iterator[dict[str, object]]:
    """Yield errors of the openness by its directions, and what its reach changes."""
    caster = Caster(volume.grid, volume.look)
    matter = Matter(caster, volume.tfs, volume.look.opacity_unit)
    light = Light("headlight", occlusion=1.0)
    plain = caster.cast(volume.tfs, camera, light.unhidden).rgba
    for reach in REACHES:
        exact = opened(matter, MOST, reach)
        places = surface(caster, volume.tfs, camera, exact.outset)
        expected, pictured = exact.at(places)[:, 1], caster.cast(volume.tfs, camera, light, cells=exact).rgba
        changed = decibels(plain, pictured[..., :3], pictured[..., 3])
        yield {
            "measure": "no occlusion",
            "choice": reach,
            **changed,
            "openness": 255 * float(expected.mean()),
        }
        for count in DIRECTIONS:
            cells = opened(matter, count, reach)
            error = 255 * (cells.at(places)[:, 1] - expected).abs().numpy()
            seen = caster.cast(volume.tfs, camera, light, cells=cells).rgba
            yield {
                "measure": f"directions, reach {reach:g}",
                "choice": count,
                **decibels(seen, pictured[..., :3], pictured[..., 3]),
                "mean error": float(error.mean()),
                "99th percentile": float(np.percentile(error, 99)),
            }


def opened(matter: Matter, count: int, reach: float) -> LightCells:
    """Return cells with the openness from any number of directions."""
    light = torch.full((*matter.extinction.shape, 2), 255, dtype=torch.uint8)
    cells = LightCells(light, matter.half)
    directions = even_directions(count)
    arguments = (NativeCells(cells.size, cells.half), matter.extinction, count, directions, reach, light)
    native.call("texgs_openness", *arguments, device=light.device)
    return cells


def surface(caster: Caster, tfs: Sequence[TransferFunction], camera: Camera, outset: float) -> Tensor:
    """Return places [N, 3] along the normals of what is seen at half of the light of each pixel."""
    seen = caster.cast(tfs, camera, Light("headlight"), ("median", "normal"))
    places = camera.position + seen.median[..., None] * camera.rays()
    return (places + outset * seen.normal)[(seen.rgba[..., 3] > SOLID) & (seen.median > 0)]


if __name__ == "__main__":
    call(main, "texgs.volume.matter texgs.volume.light_cells texgs.volume.caster")
