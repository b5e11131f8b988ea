"""Open a volume of any known format, chosen by the file's suffix."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from texgs.core.errors import ArgumentError, TexgsError
from texgs.volume.formats import open_nifti, open_npy, open_raw
from texgs.volume.grid import Dims, Triple
from texgs.volume.metaimage import open_metaimage
from texgs.volume.nrrd_file import open_nrrd
from texgs.volume.slabs import ArraySource, RawSource, Source
from texgs.volume.slc import open_slc
from texgs.volume.tiff import open_tiff
from texgs.volume.vtk_files import open_vtk

__all__ = ["ArraySource", "RawSource", "Source", "open_source"]

RAW_SUFFIXES = (".raw", ".bin", ".dat")
# Suffix: function of the path, and of spacing and origin where they replace the file's.
OPENERS: dict[str, Callable[[Path, Triple | None, Triple | None], Source]] = {
    ".nrrd": open_nrrd,
    ".nhdr": open_nrrd,
    ".mhd": open_metaimage,
    ".mha": open_metaimage,
    ".vti": open_vtk,
    ".vtk": open_vtk,
    ".slc": open_slc,
    ".nii": open_nifti,
    ".nii.gz": open_nifti,
    ".tif": open_tiff,
    ".tiff": open_tiff,
    ".npy": open_npy,
}


def open_source(
    path: str | Path,
    *,
    dims: Dims | None = None,
    dtype: str | None = None,
    endian: str = "little",
    skip: int = 0,
    spacing: Triple | None = None,
    origin: Triple | None = None,
) -> Source:
    """Open a volume without reading its samples where the format allows that.

    Formats: .raw, .bin, .dat (plain samples, described by the arguments); .nrrd, .nhdr; .mhd, .mha; .slc;
    .vti and .vtk (image data, first point array); .nii, .nii.gz; .tif, .tiff (one page per z slice, row 0 is
    y = 0), or a folder of single TIFFs in natural order; .npy (an array [Z, Y, X]). x is the fastest axis
    throughout. Axes are permuted and flipped to the closest ones of physical space where the format tells
    about it: R, A, S of NIfTI. They are not resampled where they are oblique.

    Args:
        path: file, or folder of TIFFs.
        dims: samples along x, y, z; plain samples only.
        dtype: numpy's name of the sample type, such as "uint16"; plain samples only.
        endian: "little" or "big"; plain samples only.
        skip: bytes before the first sample; plain samples only.
        spacing: replaces the file's, x, y, z.
        origin: replaces the file's, x, y, z.

    Raises:
        ArgumentError, ShapeError: if the file is missing, cannot be read, is unknown, damaged or no scalar
            volume.
        OutOfMemoryError: if the format is one that is read as a whole, and the samples do not fit.
    """
    path = Path(path)
    try:
        _try_to_read(path)
        if path.is_file() and _suffix(path) in RAW_SUFFIXES:
            return open_raw(path, dims, dtype, endian, skip, spacing, origin)
        if (dims, dtype, endian, skip) != (None, None, "little", 0):
            raise ArgumentError(
                f"dims, dtype, endian and skip describe plain samples ({', '.join(RAW_SUFFIXES)}), but this "
                "format has a header; leave them out"
            )
        return _opener(path)(path, spacing, origin)
    except TexgsError as error:
        raise type(error)(f"{path}: {error}") from error
    except FileNotFoundError as error:
        path = Path(error.filename or path)
        raise ArgumentError(f"{path}: no such file or folder; looked for {path.absolute()}") from error
    except OSError as error:
        path = Path(error.filename or path)
        raise ArgumentError(f"{path}: cannot be read ({error.strerror or error})") from error


def _try_to_read(path: Path) -> None:
    """Raise where that is not possible; the readers of the formats say it each in other words."""
    if path.is_dir():
        next(path.iterdir(), None)
    elif path.exists() and not path.is_file():
        raise ArgumentError("expected a file or a folder, got a named pipe, a device or a socket")
    else:
        path.open("rb").close()


def _suffix(path: Path) -> str:
    """Suffix in lower case; both where a file is compressed as a whole."""
    suffixes = [suffix.lower() for suffix in path.suffixes]
    return "".join(suffixes[-2:] if suffixes[-1:] == [".gz"] else suffixes[-1:])


def _opener(path: Path) -> Callable[[Path, Triple | None, Triple | None], Source]:
    """Function that opens the format."""
    if path.is_dir():
        return open_tiff
    try:
        return OPENERS[_suffix(path)]
    except KeyError as error:
        known = ", ".join((*RAW_SUFFIXES, *OPENERS))
        raise ArgumentError(
            f"unknown suffix {_suffix(path)!r}; expected {known}, or a folder of TIFFs"
        ) from error
