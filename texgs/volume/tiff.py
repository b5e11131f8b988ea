"""TIFF files with a page per slice, and folders of single TIFFs, as sources; read by OpenCV, page by page."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.core.names import SLICES
from texgs.core.reading import ADVICE, reading_as
from texgs.volume.grid import Dims, Triple, check_lattice
from texgs.volume.slabs import SLAB_BYTES

HEAD = 1 << 16  # bytes in which ImageJ's description of a stack is
CHANNELS = re.compile(rb"ImageJ=[^\0]*\nchannels=(\d+)")


@dataclass(frozen=True, eq=False)
class PageSource:
    """Slices that are pages of one TIFF file, or files of one page, decoded when they are asked for."""

    path: Path
    files: tuple[Path, ...]  # one, or one for each slice
    dims: Dims
    dtype: np.dtype
    spacing: Triple
    origin: Triple

    def __post_init__(self) -> None:
        check_lattice(self.dims, self.dtype, self.spacing, self.origin)

    @property
    def name(self) -> str:
        """Name of the file or folder."""
        return self.path.name

    def slices(self, start: int, stop: int) -> np.ndarray:
        """Samples [stop - start, Y, X]; row 0 of a page is y = 0."""
        values = np.empty((stop - start, *self.dims[1::-1]), self.dtype)
        if len(self.files) > 1:
            for place, file in zip(values, self.files[start:stop], strict=True):
                self._copy(place[None], file, 0)
            return values
        step = max(1, SLAB_BYTES // values[0].nbytes)
        for low in range(0, stop - start, step):
            self._copy(values[low : low + step], self.path, start + low)
        return values

    def _copy(self, places: np.ndarray, file: Path, first: int) -> None:
        """Fill [n, Y, X] with pages of a file, which must be like the first."""
        where = "" if file == self.path else f"{file}: "
        for place, page in zip(places, read_pages(file, first, len(places)), strict=True):
            if page.shape != place.shape or page.dtype != self.dtype:
                raise ArgumentError(
                    f"{where}expected a page {list(place.shape)} of {self.dtype} as the first one, "
                    f"got {list(page.shape)} of {page.dtype}"
                )
            place[:] = page


def open_tiff(path: Path, spacing: Triple | None, origin: Triple | None) -> PageSource:
    """Open a TIFF file with a page per z slice, or a folder of single TIFFs in natural order.

    TIFF says nothing dependable about the lattice: spacing is 1 unless given.

    Raises:
        ArgumentError: if a file is damaged or there is no scalar volume.
    """
    files = tuple(tiffs_in(path)) if path.is_dir() else (path,)
    count = page_count(files[0])
    if path.is_dir() and count != 1:
        raise ArgumentError(f"expected one page per file, got {count} in {files[0].name}")
    page = read_pages(files[0], 0, 1)[0]
    with files[0].open("rb") as file:
        channels = CHANNELS.search(file.read(HEAD))
    n_components = page.shape[2] if page.ndim > 2 else int(channels[1]) if channels else 1
    if n_components > 1:
        raise ArgumentError(f"expected a scalar volume, got {n_components} components per sample")
    dims = (page.shape[1], page.shape[0], len(files) if path.is_dir() else count)
    return PageSource(path, files, dims, page.dtype, spacing or (1.0, 1.0, 1.0), origin or (0.0, 0.0, 0.0))


def tiffs_in(folder: Path) -> list[Path]:
    """Return the TIFF files of a folder in natural order."""
    return sorted((file for file in folder.iterdir() if file.suffix.lower() in SLICES), key=natural_order)


def page_count(file: Path) -> int:
    """Count the pages of a TIFF file."""
    import cv2

    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # what is wrong is raised here
    try:
        str(file).encode()
    except UnicodeEncodeError as error:  # OpenCV would crash
        raise ArgumentError("expected a path in UTF-8; rename it") from error
    with reading_as(f"TIFF files, but {file.name} is none" if file.name else "a TIFF file"):
        return int(cv2.imcount(str(file)))


def read_pages(file: Path, first: int, count: int) -> list[np.ndarray]:
    """Read pages of a TIFF file, each [Y, X] or [Y, X, C].

    Raises:
        ArgumentError: if there are fewer, or one of them is damaged.
    """
    import cv2

    with reading_as("a TIFF file"):
        _, pages = cv2.imreadmulti(str(file), first, count, flags=cv2.IMREAD_UNCHANGED)
    if len(pages) != count:
        raise ArgumentError(
            f"{file}: expected a TIFF file, but page {first + len(pages)} cannot be decoded; {ADVICE}"
        )
    return list(pages)


def natural_order(path: Path) -> list[tuple[str, int]]:
    """Sort key: numbers in a name count as numbers, so that slice9 comes before slice10."""
    return [(text, int(number or -1)) for text, number in re.findall(r"(\D*)(\d*)", path.name)]
