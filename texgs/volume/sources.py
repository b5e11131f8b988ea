"""Open a volume of any known format, chosen by the file's suffix."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from texgs.core.errors import ArgumentError, located
from texgs.core.io import reading_as
from texgs.volume.foreign import BY_VTK, DICOM, open_foreign
from texgs.volume.grid import ONES, ZEROS, Dims, Grid, Triple, byte_count, check_lattice, dims_of
from texgs.volume.headers import METAIMAGE, NRRD
from texgs.volume.mrc import MAPS, open_mrc
from texgs.volume.netcdf import open_netcdf
from texgs.volume.nifti import BY_NIBABEL, open_nifti
from texgs.volume.ome_zarr import is_zarr, open_zarr
from texgs.volume.pointers import require_itself, require_packing
from texgs.volume.slabs import ArraySource, RawSource, Source, size_text
from texgs.volume.slice_names import tiffs_in
from texgs.volume.text_columns import ColumnSource
from texgs.volume.tiff import open_tiff

# Tried in this order where the size of a plain file does not fit the type given.
COMMON_TYPES = ("uint8", "uint16", "float32", "float64")
DEFAULTS = {"endian": "little", "skip": 0, "time": 0}  # of keys, which every format may be given
HDF5 = (".nc", ".nc4", ".h5", ".hdf5", ".hdf", ".nxs")
IMARIS = (
    "Imaris pads arrays with zeros, and tells size and extent by text that is not read: dataset.volume.crop "
    "and spacing set them"
)
IN_FILES = ("variable", "channel", "time")  # keys of an array among others
IN_PAGES = ("image", "channel", "time")  # keys of an image of TIFF


def open_source(
    path: str | Path, *, spacing: Triple | None = None, origin: Triple | None = None, **keys: Any
) -> Source:
    """Open a volume without reading its samples where the format allows that.

    Formats: .raw, .bin, .dat (plain samples, described by the arguments); .npy, .npz (an array [Z, Y, X]);
    .tif, .tiff (one page per z slice, row 0 is y = 0), or a folder of single TIFFs that numbers count; a
    folder of DICOM slices, or .dcm, .ima with many frames; .nrrd, .nhdr; .mhd, .mha; .nii, .nii.gz, .hdr,
    .img, .mgh, .mgz; .mrc, .map, .ccp4, .rec, also with .gz; .gipl; .slc; .vti, .vtr, .pvti, .pvtr and .vtk
    (arrays of points or cells); .nc, .nc4, .h5, .hdf5, .hdf, .nxs, .ims; a folder of Zarr, or its .zip, .ozx;
    .txt, .txt.gz (a line per sample). x is the fastest axis throughout, unless an array has labels
    that say where its axes run.
    Axes are permuted and flipped to the closest ones of physical space where the format tells about it:
    R, A, S of NIfTI; L, P, S of DICOM. They are not resampled where they are oblique.

    Args:
        path: file, or folder of slices.
        spacing: replaces the file's, x, y, z.
        origin: replaces the file's, x, y, z.
        keys: what only some formats take: `dims`, samples along x, y, z; `dtype`, numpy's name of
            the sample type, such as "uint16"; `endian`, "little" or "big"; `skip`, bytes before the first
            sample; `series`, number or UID of one of several; `variable`, the path of an array in the file;
            `image`, name or number, from 0, of one of several of TIFF; `channel`, its label or number, from
            0; `time`, a step, from 0 (the default), of arrays, TIFF, NIfTI, NRRD, MetaImage and DICOM;
            `column`, from 1.

    Raises:
        ArgumentError, ShapeError: if the file is missing, cannot be read, is unknown, damaged or no scalar
            volume.
        OutOfMemoryError: if the format is one that is read as a whole, and the samples do not fit.
    """
    path = Path(path)
    said = {key: value for key, value in keys.items() if value not in (None, DEFAULTS.get(key))}
    try:
        with located(path):
            _try_to_read(path)
            return _open(path, spacing, origin, said)
    except OSError as error:
        path, why = Path(error.filename or path), f"cannot be read ({error.strerror or error})"
        if isinstance(error, FileNotFoundError):
            why = f"no such file or folder; looked for {path.absolute()}"
            if path.is_symlink():
                why = f"a link to {path.readlink()}, which is not there; get it, as by git annex get"
        raise ArgumentError(f"{path}: {why}") from error


def _try_to_read(path: Path) -> None:
    """Raise where that is not possible; the readers of the formats say it each in other words."""
    if path.is_dir():
        files = (each for each in path.iterdir() if not each.name.startswith(".") and not each.is_dir())
        if first := min(files, default=None):
            with located(first.name):
                require_itself(first)
    elif path.exists() and not path.is_file():
        raise ArgumentError("expected a file or a folder, got a named pipe, a device or a socket")
    else:
        require_packing(path, OPENERS)


def _suffix(path: Path) -> str:
    """Return the suffix in lower case; both where a file is compressed as a whole."""
    suffixes = [suffix.lower() for suffix in path.suffixes]
    return "".join(suffixes[-2:] if suffixes[-1:] == [".gz"] else suffixes[-1:])


def holds_arrays(path: Path) -> bool:
    """Return whether a file is of a format of arrays, which are read as needed and may have channels."""
    return "channel" in _opener(path)[1]


def tells_superior(path: Path) -> bool:
    """Return whether z points to the head by a volume's format: of NIfTI, and of a folder of DICOM."""
    opener, _ = _opener(path)
    return opener is open_nifti or (opener is open_foreign and (path.is_dir() or _suffix(path) in DICOM))


def _opener(path: Path) -> tuple[Callable[..., Source] | None, tuple[str, ...]]:
    """Return what opens a file or a folder, and the keys that it takes."""
    suffix = _suffix(path)
    if not path.is_dir():
        return OPENERS.get(suffix, (None, ()))
    if is_zarr(path) or suffix == ".zarr":
        return open_zarr, IN_FILES
    return (open_tiff, IN_PAGES) if tiffs_in(path) else (open_foreign, ("series", "time"))


def _open(path: Path, spacing: Triple | None, origin: Triple | None, said: dict[str, Any]) -> Source:
    """Open a file by its suffix, or a folder of slices; `said` are keys that only some formats take."""
    opener, takes = _opener(path)
    if path.name.upper() == "DICOMDIR":
        raise ArgumentError(
            "expected a volume, got a list of files of DICOM; open the folder of a series below it"
        )
    if opener is None:
        raise ArgumentError(
            f"unknown suffix {_suffix(path)!r}; expected {', '.join(OPENERS)}, or a folder of slices or Zarr"
        )
    if unfit := [key for key in said if key not in takes]:
        raise ArgumentError(f"{', '.join(unfit)}: not for this format; leave them out")
    return opener(path, spacing, origin, **said)


def _open_raw(
    path: Path,
    spacing: Triple | None,
    origin: Triple | None,
    dims: Dims | None = None,
    dtype: str | None = None,
    endian: str = "little",
    skip: int = 0,
) -> RawSource:
    """Open plain samples; the file's size must fit exactly, the only check there is."""
    if dims is None or dtype is None:
        missing = " and ".join(key for key, value in (("dims", dims), ("dtype", dtype)) if value is None)
        raise ArgumentError(f"plain samples have no header; set {missing}, and endian and skip where needed")
    if endian not in ("little", "big"):
        raise ArgumentError(f"endian: expected little or big, got {endian!r}")
    try:
        stored = np.dtype(dtype).newbyteorder("<" if endian == "little" else ">")
    except (SyntaxError, TypeError) as error:
        raise ArgumentError(f"dtype: expected a name such as uint8 or float32, got {dtype!r}") from error
    check_lattice(dims, stored)
    size = path.stat().st_size
    if size != skip + byte_count(dims, stored):
        fits = [name for name in COMMON_TYPES if size == skip + byte_count(dims, np.dtype(name))]
        advice = f"dtype {fits[0]} would fit" if fits else "correct dims, dtype or skip"
        raise ArgumentError(f"expected {size_text(dims, stored, skip)}, found {size}; {advice}")
    return RawSource(path, dims, stored, skip, spacing or ONES, origin or ZEROS)


def _open_npy(
    path: Path, spacing: Triple | None, origin: Triple | None, variable: str | None = None
) -> Source:
    """Open a NumPy array [Z, Y, X], or one of an archive."""
    with reading_as(f"a {path.suffix.lower()} file"):
        values = np.load(path, mmap_mode="r", allow_pickle=False)
        if isinstance(values, np.lib.npyio.NpzFile):
            with values as arrays:
                name = variable or (arrays.files[0] if len(arrays.files) == 1 else "none")
                if name not in arrays.files:
                    known = ", ".join(arrays.files)
                    raise ArgumentError(f"dataset.volume.variable: expected one of {known}, got {name}")
                values = arrays[name]
    lattice = (spacing or ONES, origin or ZEROS)
    if isinstance(values, np.memmap) and values.flags.c_contiguous:
        return RawSource(path, dims_of(values.shape), values.dtype, values.offset, *lattice)
    return ArraySource(Grid(values, *lattice), path.name)


def _open_imaris(path: Path, spacing: Triple | None, origin: Triple | None, **keys: Any) -> Source:
    """Open an array of Imaris as one of HDF5."""
    source = open_netcdf(path, spacing, origin, **keys)
    source.note = "; ".join(filter(None, (source.note, "" if spacing else IMARIS)))
    return source


# Function of the path, of spacing and origin where they replace the file's, and of these keys; suffixes.
FORMATS: tuple[tuple[Callable[..., Source], tuple[str, ...], tuple[str, ...]], ...] = (
    (_open_raw, ("dims", "dtype", "endian", "skip"), (".raw", ".bin", ".dat")),
    (open_tiff, IN_PAGES, (".tif", ".tiff")),
    (_open_npy, (), (".npy",)),
    (_open_npy, ("variable",), (".npz",)),
    (open_nifti, ("time",), BY_NIBABEL),
    (open_foreign, ("channel", "time"), (*NRRD, *METAIMAGE)),  # by SimpleITK
    (open_foreign, (), (".gipl",)),
    (open_mrc, (), (*MAPS, *(f"{suffix}.gz" for suffix in MAPS))),
    (open_foreign, ("variable",), BY_VTK),
    (open_foreign, ("time",), DICOM),
    (open_netcdf, IN_FILES, HDF5),
    (_open_imaris, IN_FILES, (".ims",)),
    (open_zarr, IN_FILES, (".zip", ".ozx")),
    (ColumnSource, ("dims", "column"), (".txt", ".txt.gz")),
)
OPENERS = {suffix: (opener, keys) for opener, keys, suffixes in FORMATS for suffix in suffixes}
