"""TIFF files with a page per slice, and folders of single TIFFs, as sources."""

import logging
import re
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from texgs.core.errors import ArgumentError, located
from texgs.core.io import reading_as
from texgs.core.names import SLICES, natural_order
from texgs.volume.axes import METRES
from texgs.volume.grid import ONES, ZEROS, Grid, Triple, dims_of, require_room
from texgs.volume.slabs import ArraySource, RawSource, Source

READABLE = (1, 8, 32773, 32946, 34925)  # none, deflate, packbits and LZMA: others need imagecodecs
PAGES = 2  # in memory at a time: one as it is decoded, and its place in the slab


class PageSource(Source):
    """Slices that are pages of TIFF files, decoded when they are asked for.

    `pages` are the file and the page of every z slice, `shape` Y and X of each, `lattice` spacing and origin.
    """

    def __init__(
        self,
        path: Path,
        pages: list[tuple[Path, int]],
        shape: tuple[int, int],
        dtype: np.dtype,
        lattice: tuple[Triple, Triple],
    ) -> None:
        super().__init__(path.name, (shape[1], shape[0], len(pages)), dtype, *lattice)
        self._pages, self._shape = pages, shape

    def slices(self, start: int, stop: int) -> np.ndarray:
        """Return samples [stop - start, Y, X]; row 0 of a page is y = 0."""
        values = np.empty((stop - start, *self._shape), self.dtype)
        for k, (file, page) in enumerate(self._pages[start:stop]):
            values[k] = self._page(file, page)
        return values

    def _page(self, file: Path, page: int) -> np.ndarray:
        """Return one slice, which must be like the first."""
        import tifffile

        with located(file), reading_as("a TIFF file"), complaints_raised():
            values = tifffile.imread(file, key=page)
        if values.shape != self._shape or values.dtype != self.dtype:
            raise ArgumentError(
                f"{file}: expected a page {list(self._shape)} of {self.dtype} as the first one, "
                f"got {list(values.shape)} of {values.dtype}"
            )
        return values


def open_tiff(path: Path, spacing: Triple | None, origin: Triple | None) -> Source:
    """Open a TIFF file with a page per z slice, or a folder of single TIFFs in natural order.

    Pages of one file that follow one another uncompressed are read as they are, others on demand; of a folder
    only the first file is opened now. Spacing is what ImageJ or OME has written, else 1.
    """
    import tifffile

    files = tiffs_in(path) if path.is_dir() else [path]
    if path.is_dir() and (others := sorted(path.glob("[!.]*.[dD][cC][mM]"))):
        raise ArgumentError(
            f"expected slices of one format, got {files[0].name} and {others[0].name}; move those of one away"
        )
    what = f"TIFF files, but {files[0].name} is none" if path.is_dir() else "a TIFF file"
    with reading_as(what), complaints_raised(), tifffile.TiffFile(files[0]) as tiff:
        known = spacing or spacing_of(tiff)
        source = _source(tiff, path, files, (known or ONES, origin or ZEROS))
    source.note = (
        "" if known else "TIFF tells no spacing, so that samples are 1 apart; dataset.volume.spacing sets it"
    )
    return source


def _source(tiff: Any, path: Path, files: list[Path], lattice: tuple[Triple, Triple]) -> Source:
    """Return the source of an open file, or of a folder of which it is the first."""
    shape, dtype = _page_type(tiff.pages[0])
    if path.is_dir():
        if len(tiff.pages) != 1:
            raise ArgumentError(f"expected one page per file, got {len(tiff.pages)} in {files[0].name}")
        require_all_slices(files)
        return PageSource(path, [(file, 0) for file in files], shape, dtype, lattice)
    series = tiff.series[0]
    for axis, size in zip(series.axes, series.shape, strict=False):
        if axis in "CS" and size > 1:
            raise ArgumentError(f"expected a scalar volume, got {size} components per sample")
    if len(tiff.series) == 1 and series.ndim > 2:
        dims = dims_of(series.shape)
        if series.dataoffset is not None:
            stored = dtype.newbyteorder(tiff.byteorder)
            return RawSource(path, dims, stored, series.dataoffset, *lattice)
        if len(tiff.pages) != dims[2]:
            require_room(dims, dtype)
            return ArraySource(Grid(series.asarray(), *lattice), path.name)
    return PageSource(path, [(path, page) for page in range(len(tiff.pages))], shape, dtype, lattice)


def spacing_of(tiff: Any) -> Triple | None:
    """Return the spacing x, y, z, in the unit of x, that OME or ImageJ has written into a file; else None."""
    import tifffile

    if tiff.is_ome:
        images = tifffile.xml2dict(tiff.ome_metadata).get("OME", {}).get("Image", {})  # or in another file
        pixels = (images[0] if isinstance(images, list) else images).get("Pixels", {})
        units = [METRES.get(pixels.get(f"PhysicalSize{axis}Unit", "µm"), 0.0) for axis in "XYZ"]
        x, y, z = (
            float(pixels.get(f"PhysicalSize{axis}", 0)) * unit
            for axis, unit in zip("XYZ", units, strict=True)
        )
        return (x / units[0], y / units[0], z / units[0]) if min(x, y, z) > 0 else None
    depth = (tiff.imagej_metadata or {}).get("spacing")
    tags = [tiff.pages[0].tags.get(name) for name in ("XResolution", "YResolution")]
    if not depth or not all(tag and tag.value[0] for tag in tags):
        return None
    dx, dy = (tag.value[1] / tag.value[0] for tag in tags)  # pixels in a unit
    return dx, dy, abs(float(depth))  # below 0 for slices from the top down, by ImageJ


def tiffs_in(folder: Path) -> list[Path]:
    """Return the TIFF files of a folder in natural order: slice9 comes before slice10."""
    files = (file for file in folder.iterdir() if not file.name.startswith("."))  # as ._ files of macOS
    return sorted((file for file in files if file.suffix.lower() in SLICES), key=natural_order)


def require_all_slices(files: list[Path]) -> None:
    """Require that the numbers in the names of slices, which are in order, have no gap."""
    numbers = [int(digits[-1]) for file in files if (digits := re.findall(r"\d+", file.stem))]
    steps = [after - before for before, after in pairwise(numbers)]
    if len(numbers) < len(files) or not steps or min(steps) < 1:
        return  # names that do not count slices
    for before, after, step in zip(files, files[1:], steps, strict=False):
        if step != min(steps):
            raise ArgumentError(
                f"{before.name} and {after.name}: expected numbers {min(steps)} apart, as of other slices, "
                f"got {step}: some are missing; add them, or rename the files if these are all"
            )


def _page_type(page: Any) -> tuple[tuple[int, int], np.dtype]:
    """Return the shape (Y, X) and sample type of a page that can be read."""
    if page.samplesperpixel != 1:
        raise ArgumentError(f"expected a scalar volume, got {page.samplesperpixel} components per sample")
    if page.compression not in READABLE and find_spec("imagecodecs") is None:
        raise ArgumentError(
            f"expected samples that are uncompressed or deflated, got {page.compression.name}; save them so, "
            "or pip install imagecodecs"
        )
    require_room((page.imagewidth, page.imagelength, PAGES), np.dtype(page.dtype))
    return (page.imagelength, page.imagewidth), np.dtype(page.dtype)


@contextmanager
def complaints_raised() -> Iterator[None]:
    """Raise what tifffile only logs: lost pages, for one. Warnings are about metadata and are dropped."""
    records: list[logging.LogRecord] = []
    collector = logging.Handler(logging.WARNING)
    collector.emit = records.append  # type: ignore[assignment,method-assign]
    logger = logging.getLogger("tifffile")
    propagates, logger.propagate = logger.propagate, False
    logger.addHandler(collector)
    try:
        yield
    finally:
        logger.propagate = propagates
        logger.removeHandler(collector)
    for record in records:
        if record.levelno >= logging.ERROR:
            raise ArgumentError(f"the file is damaged or cut off, tifffile says: {record.getMessage()}")
