"""The inputs of the looks in a comparison, as a row beside their views."""

from collections.abc import Collection, Mapping
from pathlib import Path
from textwrap import fill

import numpy as np
from PIL import Image, ImageOps

from texgs.core.figures import Cell, Row, as_picture
from texgs.core.names import mask_name, style_file
from texgs.volume.transfer import TransferFunction

SIDE, INCHES = 512, 3.2  # side of a picture, pixels and inches; the inches determine the font size
LINE_LENGTH = 18  # letters


def given_row(
    plot: np.ndarray | None,
    styles: Mapping[str, str],
    instructions: Mapping[str, str],
    scenes: Collection[Path],
) -> Row:
    """Return a row of a plot, of style pictures beside edited scenes, and of instructions."""
    cells = [] if plot is None else [Cell("transfer functions", plot)]
    for name, style in styles.items():
        files = [scene.with_name(file) for scene in scenes for file in map(style_file, (name, ""))]
        for file in [file for file in files if file.is_file()][:1]:  # methods with several pictures have none
            with Image.open(file) as picture:
                square = ImageOps.pad(picture.convert("RGB"), (SIDE, SIDE), color="white")
            cells.append(Cell(f"{name}: {Path(style).stem}", np.asarray(square)))
    cells += [Cell(name, words=fill(f"“{text}”", LINE_LENGTH)) for name, text in instructions.items()]
    return Row("given", cells)


def tf_plot(volume: Path, basic: Mapping[str, TransferFunction]) -> np.ndarray:
    """Return a square plot [S, S, 3] of transfer functions over the histogram of volume.nrrd."""
    from texgs.volume.summaries import read_summaries
    from texgs.volume.tf_plot import plot

    known = read_summaries(volume)
    panels = len({name.startswith(mask_name("")) or name for name in known})  # labels share one
    figure = plot(known, basic, size=(INCHES, INCHES / panels), dpi=SIDE / INCHES)
    for axes in figure.axes:
        if axes.get_ylabel() == "voxels":
            axes.set_axis_off()
    return np.asarray(as_picture(figure).convert("RGB"))
