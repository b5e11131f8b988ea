"""The volume of a scene in a page: fewer samples, in 8 bits at most, packed."""

import zlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from math import prod
from typing import Any

import numpy as np
import torch
from torch.nn import functional as F

from texgs.core.errors import ArgumentError, errors_at
from texgs.scene.scene import Scene, volume_of
from texgs.volume.grid import Grid, Triple
from texgs.volume.nrrd_file import REMEDY
from texgs.volume.slices import planes_of, window_of

MEGABYTE = 10**6
LEVELS = 255  # the largest code of 8 bits
CODE_STEPS = (1, 3, 5, 7)  # between codes; the one that comes closest counts
TURN_COST = 5.0  # codes; slopes that turn by a right angle count as much
STEEP_SLOPE = 0.5  # codes a sample; a slope has a direction from here on
COMPARED_PLANES = 24
SAMPLES_PER_BYTE = 6  # of packed ones, at first guess
FILLED_SHARE = 0.92  # of a budget: more is not tried for
TRIES = 8
MOST_SAMPLES = 2**26  # each takes a byte on a graphics card
LONGEST_SIDE = 1024  # samples; all graphics cards hold that


@dataclass(frozen=True, eq=False)
class PageVolume:
    """Samples on a coarser lattice between the same corners, as codes of values."""

    codes: np.ndarray  # [C Z, Y, X] uint8, one channel behind the other
    step: int  # between codes
    ends: list[tuple[float, float]]  # values of the least and the largest code of each channel
    half: Triple  # half the sides of the box between the corners, x, y, z, world units
    packed: bytes
    numbers: Sequence[int] = (0,)  # of the channels, in the volume

    def __str__(self) -> str:
        """Say how much is left of a volume."""
        (z, y, x), (low, high), count = self.codes.shape, self.ends[0], len(self.ends)
        step = f"in steps of {self.step * (high - low) / LEVELS:.3g}"
        of = step if count == 1 else f"of {count} channels"
        return f"{x} x {y} x {z // count} samples {of}, {len(self.packed) / MEGABYTE:.2f} MB"

    def describe(self, scene: Scene) -> dict[str, Any]:
        """Return what a page needs beside the samples to draw the volume of a scene."""
        known = zip(self.numbers, self.ends, strict=True)
        channels = [{"number": number, "low": low, "high": high} for number, (low, high) in known]
        facts = {"channels": channels, "half": self.half, "looks": scene.has_looks}
        return {**facts, "appearance": asdict(volume_of(scene).appearance)}

    def slices(self, scene: Scene) -> dict[str, Any]:
        """Return planes of slices of the file, and what a page needs beside the samples to draw them."""
        grid, (low, high) = volume_of(scene).open(), self.ends[0]
        step = self.step * (high - low) / LEVELS
        facts = {"window": window_of(grid), "step": step, "matrix": grid.world.matrix}
        return {"planes": [asdict(plane) for plane in planes_of(grid)], **facts}


def page_volume(scene: Scene, budget: float) -> PageVolume:
    """Return the channels that a scene shows of its volume, with as many samples as a budget in MB holds.

    Raises:
        ArgumentError: if the scene names no volume, or it cannot be read.
    """
    source = volume_of(scene)
    shown = [number for tf in (*source.tfs.values(), *scene.functions.values()) for number in tf.source]
    numbers = sorted({0, *(number for number in shown if number is not None)})  # slices show the first
    with errors_at("volume"):
        grid = source.open()
        first, *others = [grid.channel(number) for number in numbers]
        grid = replace(first, others=tuple(each.values for each in others))
        return replace(within(grid, budget * MEGABYTE), numbers=numbers)


def within(grid: Grid, most: float) -> PageVolume:
    """Return a volume in `most` bytes, by the step between codes that comes closest to the grid."""
    ends, best, least = [extremes(values) for values in channels_of(grid)], None, np.inf
    for step in CODE_STEPS:
        volume = finest(grid, most, ends, step)
        if volume is None:
            continue
        if step == CODE_STEPS[0] and is_finest(volume, grid):
            return volume
        if (loss := loss_of(volume, grid)) < least:
            best, least = volume, loss
    if best is None:
        raise ArgumentError(f"expected room for at least 2 samples a side, got {most:.0f} bytes; allow more")
    return best


def finest(grid: Grid, most: float, ends: list[tuple[float, float]], step: int) -> PageVolume | None:
    """Return the finest volume in `most` bytes that a few tries find: sizes are not known before."""
    share, best = min(1.0, (SAMPLES_PER_BYTE * step**0.5 * most / prod(grid.dims)) ** (1 / 3)), None
    for _ in range(TRIES):
        volume = reduced(grid, share, ends, step)
        size = len(volume.packed)
        if size <= most and (best is None or size > len(best.packed)):
            best = volume
        if FILLED_SHARE * most <= size <= most or (size < most and is_finest(volume, grid)):
            break
        share *= ((1 + FILLED_SHARE) / 2 * most / size) ** (1 / 3)
    return best


def loss_of(volume: PageVolume, grid: Grid) -> float:
    """Return an error in codes over some planes: of values, and of directions of slopes.

    Few steps keep values of noise, but make terraces of what is smooth.
    """
    depth, *sides = grid.values.shape
    places = np.linspace(0, depth - 1, COMPARED_PLANES).round().astype(int)
    channels = zip(channels_of(grid), np.split(volume.codes, len(volume.ends)), volume.ends, strict=True)
    loss = []
    for (values, codes, (low, high)), z in product(channels, places):
        made = plane_at(codes, z * (len(codes) - 1) / (depth - 1), sides)
        truth = (values[z].astype(np.float32) - low) * (LEVELS / (high - low))
        slopes, truths = (np.stack(np.gradient(x)) for x in (made, truth))
        lengths = np.linalg.norm(slopes, axis=0) * np.linalg.norm(truths, axis=0)
        turned = 1 - (slopes * truths).sum(axis=0) / np.maximum(lengths, 1e-6)
        is_steep = np.linalg.norm(truths, axis=0) > STEEP_SLOPE
        loss.append([((made - truth) ** 2).sum(), turned[is_steep].sum(), truth.size, is_steep.sum()])
    squares, turns, count, steep = np.sum(loss, axis=0)
    return float(np.sqrt(squares / count) + TURN_COST * turns / max(steep, 1))


def is_finest(volume: PageVolume, grid: Grid) -> bool:
    """Return whether no lattice with more samples may be in a page."""
    z, y, x = sizes_of(grid, 1.0)
    return volume.codes.shape == (len(volume.ends) * z, y, x)


def channels_of(grid: Grid) -> list[np.ndarray]:
    """Return the samples [Z, Y, X] of all channels."""
    return [grid.values, *grid.others]


def sizes_of(grid: Grid, share: float) -> tuple[int, ...]:
    """Return the sizes [3] of an array whose sides have a share of a grid's cells; cards hold them."""
    cells = [size - 1 for size in grid.values.shape]
    size = grid.values.size * len(channels_of(grid))
    most = min(LONGEST_SIDE / max(grid.values.shape), (MOST_SAMPLES / size) ** (1 / 3), 1.0)
    return tuple(max(round(min(share, most) * size), 1) + 1 for size in cells)


def extremes(values: np.ndarray) -> tuple[float, float]:
    """Return the least and the largest value of a prepared volume, which are finite and differ."""
    ends = [(plane.min(), plane.max()) for plane in values]  # a whole volume may be larger than memory
    low, high = (float(end) for end in (np.min(ends), np.max(ends)))
    if not -np.inf < low < high < np.inf:
        raise ArgumentError(
            f"expected finite samples of two values at least, got {low:g} to {high:g}; {REMEDY}"
        )
    return low, high


def reduced(grid: Grid, share: float, ends: list[tuple[float, float]], step: int) -> PageVolume:
    """Return the trilinear values of a grid at a coarser lattice as codes, multiples of a step.

    Means of all samples around a place would show fewer of the values that a thin wall has.
    """
    depth, *sides = sizes_of(grid, share)
    places, made = np.linspace(0, grid.values.shape[0] - 1, depth), []
    for values, (low, high) in zip(channels_of(grid), ends, strict=True):
        planes = np.stack([plane_at(values, place, sides) for place in places])
        codes = ((planes - low) * (LEVELS / step / (high - low))).round() * step
        made.append(codes.clip(0, LEVELS).astype(np.uint8))
    codes = np.concatenate(made)
    return PageVolume(codes, step, ends, grid.aabb[1], pack(codes))


def plane_at(values: np.ndarray, place: float, sides: list[int]) -> np.ndarray:
    """Return the plane [Y, X] of an array at a place along its first axis, with other sides, float32."""
    first, t = int(place), np.float32(place % 1)
    plane = values[first].astype(np.float32)
    if t:
        plane += t * (values[first + 1].astype(np.float32) - plane)
    planes = torch.from_numpy(plane)[None, None]
    return F.interpolate(planes, tuple(sides), mode="bilinear", align_corners=True)[0, 0].numpy()


def pack(codes: np.ndarray) -> bytes:
    """Return codes [C Z, Y, X] as a zlib stream of safetensors: their differences along all axes.

    Deflate packs these a quarter to a third smaller, and sums undo them.
    """
    from safetensors.numpy import save

    steps = codes
    for axis in range(3):
        steps = np.diff(steps, axis=axis, prepend=np.uint8(0))
    return zlib.compress(save({"steps": np.ascontiguousarray(steps)}))
