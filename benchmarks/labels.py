"""How often a picture of labels shows one that is not there: masks beside numbers that are interpolated.

`python -m benchmarks.labels OUTPUT.csv FILE...` looks at the ten largest labels of each file (in TEXGS_DATA,
if that is set) and at nested balls, an eighth of them cut out. A pixel shows the label that gives it most of
its colour. Its ray meets those whose binary mask, trilinear at an eighth of a voxel, reaches one half on it.
Rows have percents of the pixels on the object, of all cameras: those of a label that their ray does not meet,
and of another one than the binary masks show.
"""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd
import torch
from torch import Tensor

from benchmarks.command import call
from texgs.core.camera import Camera, orbit
from texgs.core.light import Light, random_lights
from texgs.core.progress import progress
from texgs.metrics.quality import VISIBLE_ALPHA
from texgs.volume.caster import Caster
from texgs.volume.framing import frame_of
from texgs.volume.grid import Grid
from texgs.volume.label_masks import HALF, INSIDE, MaskSource, label_counts
from texgs.volume.overlay import overlays
from texgs.volume.render import Appearance
from texgs.volume.slabs import ArraySource
from texgs.volume.sources import open_source
from texgs.volume.suggest import suggest
from texgs.volume.summaries import summarize
from texgs.volume.transfer import TransferFunction

SIZE, CAMERAS, SEED = 400, 8, 0  # pixels of either side
MOST = 10  # labels of a file
BALLS, RADII = (3, 1, 4, 2, 5), (0.9, 0.75, 0.6, 0.45, 0.3)  # labels from outside in; half sides of the cube
OPACITY = 0.95
FLAT = Appearance(ambient=1.0, diffuse=0.0, specular=0.0)
FINE = replace(FLAT, step=0.125)
LIGHT = Light("headlight")


@dataclass(frozen=True, eq=False)
class Labelled:
    """A volume of labels, and those of them that are looked at."""

    name: str
    grid: Grid
    numbers: list[int]

    @cached_property
    def masks(self) -> Grid:
        """Return a channel a label: its softened mask."""
        source, depth = ArraySource(self.grid), self.grid.dims[2]
        return self._with([MaskSource(source, number).slices(0, depth) for number in self.numbers])

    @cached_property
    def binary(self) -> Grid:
        """Return a channel a label: 255 at its samples, and 0 at others."""
        return self._with([np.uint8(INSIDE) * (self.grid.values == number) for number in self.numbers])

    def _with(self, channels: Sequence[np.ndarray]) -> Grid:
        return replace(self.grid, values=channels[0], others=tuple(channels[1:]))

    @property
    def of_masks(self) -> list[TransferFunction]:
        """Return the function of each mask."""
        return [opaque(HALF, INSIDE, channel) for channel in range(len(self.numbers))]

    @property
    def of_numbers(self) -> list[TransferFunction]:
        """Return functions of half a number to both sides of each label."""
        return [opaque(number - 0.5, number + 0.5) for number in self.numbers]

    @property
    def suggested(self) -> list[TransferFunction]:
        """Return those that are suggested for the histogram of the numbers."""
        values = self.grid.values
        summary = summarize(ArraySource(self.grid), float(values.min()), float(values.max()), (0.0, 0.0))
        found = suggest(vars(summary), len(np.unique(values)) - 1).values()
        return [next(tf for tf in found if tf.support[0] < k <= tf.support[1]) for k in self.numbers]

    def cameras(self, size: int, count: int) -> Iterator[Camera]:
        """Yield cameras from directions that are alike likely."""
        lens = frame_of(self.masks, self.of_masks).lens(width=size, height=size)
        for place in random_lights(count, SEED):
            yield orbit(place.azimuth, place.polar, *lens)


def main(output: str, *files: str) -> None:
    """Measure, print and write two rows for each way to show each volume."""
    table = pd.DataFrame([row for volume in volumes(files) for row in measured(volume)])
    print(table.round(3).to_string(index=False))
    table.round(4).to_csv(output, index=False, lineterminator="\n")


def volumes(files: Sequence[str]) -> Iterator[Labelled]:
    """Yield the made volume, then those of files."""
    yield Labelled("balls", balls(), [*BALLS])
    for file in files:
        source = open_source(found_at(file))
        grid = Grid(source.slices(0, source.dims[2]), source.spacing)
        yield Labelled(Path(file).stem, grid, [*label_counts(source)][:MOST])


def found_at(file: str) -> Path:
    """Return the path of a file of the folder of data."""
    return Path(os.environ.get("TEXGS_DATA", ""), file).resolve()


def balls(size: int = 128) -> Grid:
    """Make nested balls, each with another label than those beside its number, and cut out an eighth."""
    axis = np.linspace(-1, 1, size)
    x, y, z = axis, axis[:, None], axis[:, None, None]
    values = np.zeros((size, size, size), np.uint8)
    for radius, label in zip(RADII, BALLS, strict=True):
        values[x**2 + y**2 + z**2 < radius**2] = label
    values[(x > 0) & (y > 0) & (z > 0)] = 0
    return Grid(values)


def opaque(low: float, high: float, channel: int = 0) -> TransferFunction:
    """Return a white function of a range of values."""
    return TransferFunction(((low, OPACITY), (high, OPACITY)), ((low, 1, 1, 1),), channel)


def measured(volume: Labelled, size: int = SIZE, count: int = CAMERAS) -> list[dict[str, object]]:
    """Return a row for each way to show a volume."""
    ways = {
        "masks": (Caster(volume.masks, FLAT), volume.of_masks),
        "numbers": (Caster(volume.grid, FLAT), volume.of_numbers),
        "numbers, suggested": (Caster(volume.grid, FLAT), volume.suggested),
    }
    truth, shares = Caster(volume.binary, FINE), {way: list[Tensor]() for way in ways}
    for camera in progress([*volume.cameras(size, count)], title=volume.name, unit="view"):
        met, expected = met_by(truth, volume.of_masks, camera), weights(truth, volume.of_masks, camera)
        for way, (caster, tfs) in ways.items():
            found = weights(caster, tfs, camera)
            shown, is_object = found.argmax(0), found.sum(0) >= VISIBLE_ALPHA
            is_met, is_first = met.gather(0, shown[None])[0], expected.argmax(0) == shown
            shares[way].append(torch.stack([~is_met, ~is_first])[:, is_object])
    rows = []
    for way, found in shares.items():
        pixels = torch.cat(found, dim=1)
        unmet, other = (100 * pixels.double().mean(dim=1)).tolist()
        told = {"pixels": pixels.shape[1], "not met %": unmet, "another %": other}
        rows.append({"volume": volume.name, "labels": len(volume.numbers), "shown by": way, **told})
    return rows


def met_by(caster: Caster, tfs: Sequence[TransferFunction], camera: Camera) -> Tensor:
    """Return which labels rays meet [L, H, W], bool: nothing hides any."""
    return torch.stack([caster.cast(tf, camera, LIGHT).rgba[..., 3] > 0 for tf in tfs])


def weights(caster: Caster, tfs: Sequence[TransferFunction], camera: Camera) -> Tensor:
    """Return what each function gives to the colours of a picture [L, H, W]: three at a time are coloured."""
    found = []
    for first in range(0, len(tfs), 3):
        colors = [[float(k == first + c) for c in range(3)] for k in range(len(tfs))]
        shown = [replace(tf, color=((0.0, *rgb),)) for tf, rgb in zip(tfs, colors, strict=True)]
        together = overlays({str(k): tf for k, tf in enumerate(shown)})
        found += caster.cast(together, camera, LIGHT).rgba[..., :3].unbind(-1)
    return torch.stack(found[: len(tfs)])


if __name__ == "__main__":
    call(main, "texgs.volume.label_masks texgs.volume.caster")
