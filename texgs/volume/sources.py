"""Open a volume of any known format, chosen by the file's suffix."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple
from zipfile import ZipFile, is_zipfile

from texgs.core.errors import ArgumentError, errors_at
from texgs.core.io import reading_as
from texgs.volume.foreign import DICOM, VTK_SUFFIXES, open_foreign
from texgs.volume.grid import Triple
from texgs.volume.headers import METAIMAGE, NRRD, require_itself
from texgs.volume.label_names import SEGMENTATION
from texgs.volume.mrc import MAP_SUFFIXES, open_mrc
from texgs.volume.netcdf import open_netcdf
from texgs.volume.nifti import NIBABEL_SUFFIXES, is_label_image, open_nifti
from texgs.volume.ome_zarr import is_zarr, open_zarr
from texgs.volume.plain import open_npy, open_raw, open_text
from texgs.volume.slabs import Source
from texgs.volume.tiff import open_tiff
from texgs.volume.tiff_images import tiffs_in

DEFAULTS = {"endian": "little", "skip": 0, "time": 0}  # values that every format accepts
HDF5 = (".nc", ".nc4", ".h5", ".hdf5", ".hdf", ".nxs")
IMARIS = (
    "Imaris pads arrays with zeros, and tells size and extent by text that is not read: dataset.volume.crop "
    "and spacing set them"
)
ARRAY_KEYS = ("variable", "channel", "time")  # keys that choose an array and a part of it
IMAGE_KEYS = ("image", "channel", "time")  # keys that choose an image of TIFF and a part of it
GZIP = b"\x1f\x8b"  # the first bytes of a gzip file
ZARR_NAMES = (".zarray", ".zgroup", ".zattrs", "zarr.json")  # names in a zip of Zarr


class Format(NamedTuple):
    """How a format is opened."""

    open: Callable[..., Source]  # takes the path, spacing and origin that replace the file's, and keys
    keys: tuple[str, ...] = ()  # the keys that `open` takes
    is_superior: bool = False  # z points to the head


def open_source(
    path: str | Path, *, spacing: Triple | None = None, origin: Triple | None = None, **keys: Any
) -> Source:
    """Open a volume, if possible without reading its samples.

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
        with errors_at(path):
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
    """Refuse what cannot be read at all, before readers refuse it in words of their own."""
    if path.is_dir():
        files = (each for each in path.iterdir() if not each.name.startswith(".") and not each.is_dir())
        if first := min(files, default=None):
            with errors_at(first.name):
                require_itself(first)
    elif path.exists() and not path.is_file():
        raise ArgumentError("expected a file or a folder, got a named pipe, a device or a socket")
    else:
        _require_packing(path)


def _suffix(path: Path) -> str:
    """Return the suffix in lower case, with the one before it if the whole file is gzipped."""
    suffixes = [suffix.lower() for suffix in path.suffixes]
    return "".join(suffixes[-2:] if suffixes[-1:] == [".gz"] else suffixes[-1:])


def holds_arrays(path: Path) -> bool:
    """Return whether a file is of a format of arrays, which are read as needed and may have channels."""
    kind = _format(path)
    return kind is not None and "channel" in kind.keys


def tells_superior(path: Path) -> bool:
    """Return whether z points to the head in the format, as in NIfTI and DICOM."""
    kind = _format(path)
    return kind is not None and kind.is_superior


def tells_labels(path: Path) -> bool:
    """Return whether a file itself says that it holds labels: segments of 3D Slicer, or NIfTI's intent."""
    is_named = path.name.lower().endswith(SEGMENTATION)
    return is_named or (_suffix(path) in NIBABEL_SUFFIXES and is_label_image(path))


def _format(path: Path) -> Format | None:
    """Return the format of a file by its suffix, or of a folder by its contents."""
    if not path.is_dir():
        return FORMATS.get(_suffix(path))
    if is_zarr(path) or _suffix(path) == ".zarr":
        return Format(open_zarr, ARRAY_KEYS)
    if tiffs_in(path):
        return Format(open_tiff, IMAGE_KEYS)
    return Format(open_foreign, ("series", "time"), is_superior=True)


def _require_packing(path: Path) -> None:
    """Require gzip if and only if the suffix says so, where a format has suffixes for both."""
    start, suffix = require_itself(path), path.suffix.lower()
    is_packed = start.startswith(GZIP)
    if suffix == ".gz" and start and not is_packed and Path(path.stem).suffix.lower() + suffix in FORMATS:
        raise ArgumentError(f"expected gzip, got another file; if it is whole, rename it to {path.stem}")
    if is_packed and suffix + ".gz" in FORMATS:
        raise ArgumentError(f"expected a file that is not packed, got gzip; rename it to {path.name}.gz")
    if suffix == ".zip" and is_zipfile(path):
        with reading_as("a folder or zip of Zarr"), ZipFile(path) as archive:
            names = archive.namelist()
        if not any(name.endswith(ZARR_NAMES) for name in names):
            raise ArgumentError(f"expected a zip of Zarr, got one of {', '.join(names[:3])} ...; unpack it")


def _open(path: Path, spacing: Triple | None, origin: Triple | None, said: dict[str, Any]) -> Source:
    """Open a file or a folder by its format; `said` are keys that not every format takes."""
    kind = _format(path)
    if path.name.upper() == "DICOMDIR":
        raise ArgumentError(
            "expected a volume, got a list of files of DICOM; open the folder of a series below it"
        )
    if kind is None:
        raise ArgumentError(
            f"unknown suffix {_suffix(path)!r}; expected {', '.join(FORMATS)}, or a folder of slices or Zarr"
        )
    if unfit := [key for key in said if key not in kind.keys]:
        raise ArgumentError(f"{', '.join(unfit)}: not for this format; leave them out")
    return kind.open(path, spacing, origin, **said)


def _open_imaris(path: Path, spacing: Triple | None, origin: Triple | None, **keys: Any) -> Source:
    """Open an Imaris file, which is HDF5."""
    source = open_netcdf(path, spacing, origin, **keys)
    source.note = "; ".join(filter(None, (source.note, "" if spacing else IMARIS)))
    return source


FORMATS: dict[str, Format] = {
    **dict.fromkeys((".raw", ".bin", ".dat"), Format(open_raw, ("dims", "dtype", "endian", "skip"))),
    **dict.fromkeys((".tif", ".tiff"), Format(open_tiff, IMAGE_KEYS)),
    ".npy": Format(open_npy),
    ".npz": Format(open_npy, ("variable",)),
    **dict.fromkeys(NIBABEL_SUFFIXES, Format(open_nifti, ("time",), is_superior=True)),
    **dict.fromkeys((*NRRD, *METAIMAGE), Format(open_foreign, ("channel", "time"))),
    ".gipl": Format(open_foreign),
    **dict.fromkeys((*MAP_SUFFIXES, *(f"{suffix}.gz" for suffix in MAP_SUFFIXES)), Format(open_mrc)),
    **dict.fromkeys(VTK_SUFFIXES, Format(open_foreign, ("variable",))),
    **dict.fromkeys(DICOM, Format(open_foreign, ("time",), is_superior=True)),
    **dict.fromkeys(HDF5, Format(open_netcdf, ARRAY_KEYS)),
    ".ims": Format(_open_imaris, ARRAY_KEYS),
    **dict.fromkeys((".zip", ".ozx"), Format(open_zarr, ARRAY_KEYS)),
    **dict.fromkeys((".txt", ".txt.gz"), Format(open_text, ("dims", "column"))),
}
