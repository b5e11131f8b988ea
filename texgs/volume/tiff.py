"""TIFF files with a page per slice, and folders of single TIFFs, as sources."""

import logging
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from texgs.core.errors import ArgumentError, errors_at
from texgs.core.io import reading_as
from texgs.volume.axes import Axis, choose_places
from texgs.volume.grid import ONES, ZEROS, Grid, Triple, require_room
from texgs.volume.slabs import ArraySource, RawSource, Source
from texgs.volume.tiff_images import (
    arrange,
    axes_of,
    choose_image,
    file_of,
    images_in,
    is_set,
    require_pages,
    spacing_and_labels,
    tiffs_in,
)

# None, deflate, packbits and LZMA: others need imagecodecs.
READABLE_COMPRESSIONS = (1, 8, 32773, 32946, 34925)
PAGES_IN_MEMORY = 2  # one being decoded, and its place in the slab
LOSS_WORDS = ("subset", "incompletely")  # words of warnings about lost samples
NO_SPACING = "TIFF tells no spacing, so that samples are 1 apart; dataset.volume.spacing sets it"


class PageSource(Source):
    """Slices that are pages of TIFF files, decoded when they are asked for.

    `pages` are the file of every z slice and where its header begins there, 0 for that of the first page;
    `kind` is Y and X of each and the type of samples, `lattice` spacing and origin.
    """

    def __init__(
        self,
        path: Path,
        pages: Sequence[tuple[Path, int]],
        kind: tuple[tuple[int, int], np.dtype],
        lattice: tuple[Triple, Triple],
    ) -> None:
        self._pages, (self._shape, dtype) = pages, kind
        super().__init__(path.name, (*self._shape[::-1], len(pages)), dtype, *lattice)

    def slices(self, start: int, stop: int) -> np.ndarray:
        """Return samples [stop - start, Y, X]; row 0 of a page is y = 0."""
        values = np.empty((stop - start, *self._shape), self.dtype)
        for k, (file, offset) in enumerate(self._pages[start:stop]):
            values[k] = self._page(file, offset)
        return values

    def _page(self, file: Path, offset: int) -> np.ndarray:
        """Return one slice, which must be like the first and have all of its samples."""
        import tifffile

        with errors_at(file), reading_as("a TIFF file"), raise_complaints(), tifffile.TiffFile(file) as tiff:
            tiff.filehandle.seek(offset or tiff.pages.first.offset)
            page = tifffile.TiffPage(tiff, index=0)
            values = page.asarray()
        if values.shape != self._shape or values.dtype != self.dtype:
            raise ArgumentError(
                f"{file}: expected a page {list(self._shape)} of {self.dtype} as the first one, "
                f"got {list(values.shape)} of {values.dtype}"
            )
        if 0 in (*page.dataoffsets, *page.databytecounts):
            raise ArgumentError(f"{file}: expected a whole page, got samples that were never written")
        return values


def open_tiff(
    path: Path, spacing: Triple | None, origin: Triple | None, image: str | None = None, **keys: Any
) -> Source:
    """Open an image of a TIFF file with a page per z slice, or a folder of single TIFFs.

    Of a folder only the first file is opened now, unless it is one OME-TIFF. Spacing is what ImageJ or OME
    has written, else 1; further keys are those of `picked`.
    """
    import tifffile

    files = tiffs_in(path) if path.is_dir() else [path]
    if path.is_dir() and (others := sorted(path.glob("[!.]*.[dD][cC][mM]"))):
        raise ArgumentError(
            f"expected slices of one format, got {files[0].name} and {others[0].name}; move those of one away"
        )
    what = f"TIFF files, but {files[0].name} is none" if path.is_dir() else "a TIFF file"
    with reading_as(what), raise_complaints(), tifffile.TiffFile(files[0]) as tiff:
        images = images_in(tiff)
        is_slices = path.is_dir() and not is_set(images, files)
        if is_slices and len(tiff.pages) != 1:
            raise ArgumentError(f"expected one page per file, got {len(tiff.pages)} in {files[0].name}")
        one, note = choose_image(images, image, None if path.is_dir() else tiff)
        kind = _kind(one.keyframe)
        told, labels = spacing_and_labels(one, tiff, images)
        axes, remark = axes_of(one, labels)
        if is_slices:
            axes, files = arrange(files)
        index = choose_places([*axes, *map(Axis, "YX", kind[0])], **keys)
        sizes = [axis.size for axis in axes]
        numbers = np.arange(prod(sizes)).reshape(sizes)[tuple(index[:-2])]  # of the planes of z slices
        lattice = (spacing or told or ONES, origin or ZEROS)
        if is_slices:
            source: Source = PageSource(path, [(files[k], 0) for k in numbers], kind, lattice)
        else:
            source = _of_planes(path, one, numbers, (prod(sizes), *kind[0]), lattice)
    source.take(axes, index)
    source.note = "; ".join(filter(None, (note, remark, source.note, "" if spacing or told else NO_SPACING)))
    return source


def _of_planes(
    path: Path, image: Any, numbers: np.ndarray, whole: tuple[int, int, int], lattice: tuple[Triple, Triple]
) -> Source:
    """Return the planes with these numbers of an image [planes, Y, X].

    Those that follow one another as samples are in memory are read as they are, and pages on demand.
    """
    first, step = int(numbers[0]), int(numbers[1] - numbers[0])
    part, dtype = slice(first, int(numbers[-1]) + 1, step), np.dtype(image.dtype)
    if image.dataoffset is not None and not image.is_multifile and step == 1:
        offset = image.dataoffset + first * prod(whole[1:]) * dtype.itemsize
        stored = dtype.newbyteorder(image.parent.byteorder)
        return RawSource(file_of(image.keyframe), (*whole[:0:-1], len(numbers)), stored, offset, *lattice)
    pages = list(image)
    if is_page_each := len(pages) == whole[0] and not image.parent.is_lsm:  # its offsets may be mended
        pages = pages[part]
    require_pages(image, pages)
    if is_page_each and all(page.offset for page in pages):
        return PageSource(path, [(file_of(page), page.offset) for page in pages], (whole[1:], dtype), lattice)
    require_room(whole[::-1], dtype)
    return ArraySource(Grid(image.asarray(out="memmap").reshape(whole)[part], *lattice), path.name)


def _kind(page: Any) -> tuple[tuple[int, int], np.dtype]:
    """Return the shape (Y, X) and sample type of a page that can be read."""
    if page.samplesperpixel != 1:
        raise ArgumentError(f"expected a scalar volume, got {page.samplesperpixel} components per sample")
    if page.compression not in READABLE_COMPRESSIONS and find_spec("imagecodecs") is None:
        raise ArgumentError(
            f"expected samples that are uncompressed or deflated, got {page.compression.name}; save them so, "
            "or pip install '.[tiff]'"
        )
    require_room((page.imagewidth, page.imagelength, PAGES_IN_MEMORY), np.dtype(page.dtype))
    return (page.imagelength, page.imagewidth), np.dtype(page.dtype)


@contextmanager
def raise_complaints() -> Iterator[None]:
    """Raise what tifffile only logs: lost pages, for one. Other warnings are about metadata, and dropped."""
    records: list[logging.LogRecord] = []
    logger = logging.getLogger("tifffile")

    def collect(record: logging.LogRecord) -> bool:
        records.append(record)
        return False  # keeps it from all other handlers

    logger.addFilter(collect)
    try:
        yield
    finally:
        logger.removeFilter(collect)
    for record in records:
        said = record.getMessage()
        if record.levelno >= logging.ERROR or any(word in said for word in LOSS_WORDS):
            raise ArgumentError(f"the file is damaged or cut off, tifffile says: {said}")
