"""Names of files of slices: which of their numbers counts slices, and which count steps or channels."""

import re
from collections.abc import Sequence
from itertools import pairwise
from math import prod
from pathlib import Path

from texgs.core.errors import ArgumentError
from texgs.core.names import SLICES, natural_order
from texgs.volume.axes import Axis, Channel


def tiffs_in(folder: Path) -> list[Path]:
    """Return the TIFF files of a folder in natural order: slice9 comes before slice10."""
    files = (file for file in folder.iterdir() if not file.name.startswith("."))  # as ._ files of macOS
    return sorted((file for file in files if file.suffix.lower() in SLICES), key=natural_order)


def arranged(files: Sequence[Path]) -> tuple[list[Axis], list[Path]]:
    """Return the axes that numbers in the names count, and the files in their order, the last axis fastest.

    One number counts slices, by even steps. Others may count steps of time and channels, if the word before
    them says so (t, time, c, ch, channel) and there is a file for each combination.
    """
    parts = [re.split(r"(\d+)", file.stem) for file in files]  # text, number, text, number, ..., text
    texts = parts[0][::2]
    other = next((file for file, part in zip(files, parts, strict=True) if part[::2] != texts), None)
    columns = list(zip(*(map(int, part[1::2]) for part in parts), strict=other is None))
    varied = [k for k, column in enumerate(columns) if len(set(column)) > 1]
    axes = [_axis(texts[k] if len(varied) > 1 else "z", sorted(set(columns[k]))) for k in varied]
    slices = [k for k, axis in zip(varied, axes, strict=True) if axis.kind == "space"]
    if other or (len(files) > 1 and (len(slices) != 1 or prod(axis.size for axis in axes) != len(files))):
        raise ArgumentError(
            f"{files[0].name} and {(other or files[-1]).name}: expected names that differ by the number of "
            "the slice, or by others after t, c or ch, too; move the slices of one volume into a folder of "
            "their own, or rename them"
        )
    for k in slices:
        _require_even(dict(zip(columns[k][::-1], files[::-1], strict=True)))
    places = dict(zip(files, zip(*(columns[k] for k in varied), strict=True), strict=False))
    return axes, sorted(files, key=lambda file: places.get(file, ()))


def _axis(text: str, values: Sequence[int]) -> Axis:
    """Return the axis that a number counts, by the word before it."""
    word = re.split(r"[\W\d_]", text.lower())[-1]
    return Axis(word, len(values), channels=tuple(Channel(str(value)) for value in values))


def _require_even(files: dict[int, Path]) -> None:
    """Require that the numbers of slices, each with a file, have no gap."""
    pairs = list(pairwise(sorted(files)))
    step = min(after - before for before, after in pairs)
    for before, after in pairs:
        if after - before != step:
            raise ArgumentError(
                f"{files[before].name} and {files[after].name}: expected numbers {step} apart, as of other "
                f"slices, got {after - before}; add those that are missing, or rename the files"
            )
