"""TIFF files with a page per slice, and folders of single TIFFs, as sources."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.core.io import reading_as
from texgs.core.names import SLICES
from texgs.volume.grid import Dims, Grid, Triple, check_lattice, dims_of, require_room
from texgs.volume.slabs import ArraySource, RawSource, Source

READABLE = (1, 8, 32773, 32946, 34925)  # none, deflate, packbits and LZMA: others need imagecodecs
PAGES = 2  # in memory at a time: one as it is decoded, and its place in the slab


@dataclass(frozen=True, eq=False)
class PageSource:
    """Slices that are pages of TIFF files, decoded when they are asked for."""

    path: Path
    pages: tuple[tuple[Path, int], ...]  # file and page of every z slice
    shape: tuple[int, int]  # Y, X
    dtype: np.dtype
    spacing: Triple
    origin: Triple

    def __post_init__(self) -> None:
        check_lattice(self.dims, self.dtype, self.spacing, self.origin)

    @property
    def name(self) -> str:
        """Name of the file or folder."""
        return self.path.name

    @property
    def dims(self) -> Dims:
        """Number of samples along x, y, z."""
        return self.shape[1], self.shape[0], len(self.pages)

    def slices(self, start: int, stop: int) -> np.ndarray:
        """Samples [stop - start, Y, X]; row 0 of a page is y = 0."""
        values = np.empty((stop - start, *self.shape), self.dtype)
        for k, (file, page) in enumerate(self.pages[start:stop]):
            values[k] = self._page(file, page)
        return values

    def _page(self, file: Path, page: int) -> np.ndarray:
        """One slice, which must be like the first."""
        import tifffile

        try:
            with reading_as("a TIFF file"), _complaints():
                values = tifffile.imread(file, key=page)
        except ArgumentError as error:
            raise ArgumentError(f"{file}: {error}") from error
        if values.shape != self.shape or values.dtype != self.dtype:
            raise ArgumentError(
                f"{file}: expected a page {list(self.shape)} of {self.dtype} as the first one, "
                f"got {list(values.shape)} of {values.dtype}"
            )
        return values


def open_tiff(path: Path, spacing: Triple | None, origin: Triple | None) -> Source:
    """Open a TIFF file with a page per z slice, or a folder of single TIFFs in natural order.

    TIFF says nothing dependable about the lattice: spacing is 1 unless given.
    """
    lattice = (spacing or (1.0, 1.0, 1.0), origin or (0.0, 0.0, 0.0))
    return _open_folder(path, *lattice) if path.is_dir() else _open_file(path, *lattice)


def _open_folder(path: Path, spacing: Triple, origin: Triple) -> PageSource:
    """Open single TIFFs; only the first is opened now."""
    import tifffile

    files = tiffs_in(path)
    what = f"TIFF files, but {files[0].name} is none"
    with reading_as(what), _complaints(), tifffile.TiffFile(files[0]) as tiff:
        shape, dtype = _page_type(tiff)
        if len(tiff.pages) != 1:
            raise ArgumentError(f"expected one page per file, got {len(tiff.pages)} in {files[0].name}")
    return PageSource(path, tuple((file, 0) for file in files), shape, dtype, spacing, origin)


def tiffs_in(folder: Path) -> list[Path]:
    """Return the TIFF files of a folder in natural order."""
    files = (file for file in folder.iterdir() if file.suffix.lower() in SLICES)
    return sorted(files, key=natural_order)


def _open_file(path: Path, spacing: Triple, origin: Triple) -> Source:
    """Open pages of one file: as they are where they follow one another uncompressed, else on demand."""
    import tifffile

    with reading_as("a TIFF file"), _complaints(), tifffile.TiffFile(path) as tiff:
        shape, dtype = _page_type(tiff)
        series = tiff.series[0]
        for axis, size in zip(series.axes, series.shape, strict=False):
            if axis in "CS" and size > 1:
                raise ArgumentError(f"expected a scalar volume, got {size} components per sample")
        if len(tiff.series) == 1 and series.ndim > 2:
            dims = dims_of(series.shape)
            if series.dataoffset is not None:
                stored = dtype.newbyteorder(tiff.byteorder)
                return RawSource(path, dims, stored, series.dataoffset, spacing, origin)
            if len(tiff.pages) != dims[2]:
                require_room(dims, dtype)
                return ArraySource(Grid(series.asarray(), spacing, origin), path.name)
        pages = tuple((path, page) for page in range(len(tiff.pages)))
    return PageSource(path, pages, shape, dtype, spacing, origin)


def _page_type(tiff: Any) -> tuple[tuple[int, int], np.dtype]:
    """Return the shape (Y, X) and sample type of the first page."""
    page = tiff.pages[0]
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
def _complaints() -> Iterator[None]:
    """Raise what tifffile only logs: lost pages, for one. Warnings are about metadata and are dropped."""
    records: list[logging.LogRecord] = []

    class Collector(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            records.append(record)

    logger, collector = logging.getLogger("tifffile"), Collector(logging.WARNING)
    propagates = logger.propagate
    logger.addHandler(collector)
    logger.propagate = False
    try:
        yield
    finally:
        logger.propagate = propagates
        logger.removeHandler(collector)
    for record in records:
        if record.levelno >= logging.ERROR:
            raise ArgumentError(f"the file is damaged or cut off, tifffile says: {record.getMessage()}")


def natural_order(path: Path) -> list[tuple[str, int]]:
    """Sort key: numbers in a name count as numbers, so that slice9 comes before slice10."""
    return [(text, int(number or -1)) for text, number in re.findall(r"(\D*)(\d*)", path.name)]
