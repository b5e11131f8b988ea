"""Plain samples, NumPy arrays and NIfTI files as sources."""

from __future__ import annotations

from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.core.reading import reading_as
from texgs.volume.grid import Dims, Grid, Triple, check_lattice, dims_of, require_room
from texgs.volume.oriented import ONES, ZEROS
from texgs.volume.slabs import ArraySource, RawSource, Source

# Tried in this order where the size of a plain file does not fit the type given.
COMMON_TYPES = ("uint8", "uint16", "float32", "float64")


def open_raw(
    path: Path,
    dims: Dims | None,
    dtype: str | None,
    endian: str,
    skip: int,
    spacing: Triple | None,
    origin: Triple | None,
) -> RawSource:
    """Plain samples; the file's size must fit exactly, the only check there is.

    Raises:
        ArgumentError: if something is missing or does not fit the file.
    """
    if dims is None or dtype is None:
        missing = " and ".join(key for key, value in (("dims", dims), ("dtype", dtype)) if value is None)
        raise ArgumentError(f"plain samples have no header; set {missing}, and endian and skip where needed")
    if endian not in ("little", "big"):
        raise ArgumentError(f"endian: expected little or big, got {endian!r}")
    if skip < 0:
        raise ArgumentError(f"skip: expected at least 0 bytes, got {skip}")
    try:
        stored = np.dtype(dtype).newbyteorder("<" if endian == "little" else ">")
    except TypeError as error:
        raise ArgumentError(f"dtype: expected a name such as uint8 or float32, got {dtype!r}") from error
    check_lattice(dims, stored, spacing or ONES, origin or ZEROS)
    size = path.stat().st_size
    expected = skip + prod(dims) * stored.itemsize
    if size != expected:
        x, y, z = dims
        skipped = f" + {skip} skipped" if skip else ""
        fits = [name for name in COMMON_TYPES if size == skip + prod(dims) * np.dtype(name).itemsize]
        advice = f"dtype {fits[0]} would fit" if fits else "correct dims, dtype or skip"
        raise ArgumentError(
            f"expected {x} x {y} x {z} x {stored.itemsize} ({stored.name}){skipped} = {expected} bytes, "
            f"found {size}; {advice}"
        )
    return RawSource(path, dims, stored, skip, spacing or ONES, origin or ZEROS)


def open_npy(path: Path, spacing: Triple | None, origin: Triple | None) -> Source:
    """A NumPy array [Z, Y, X].

    Raises:
        ArgumentError, ShapeError: if the file is damaged or no scalar volume.
    """
    with reading_as("a .npy file"):
        values = np.load(path, mmap_mode="r", allow_pickle=False)
    if not isinstance(values, np.memmap):
        raise ArgumentError("expected one array in a .npy file, got an archive or a pickle")
    lattice = (spacing or ONES, origin or ZEROS)
    if values.flags.c_contiguous:
        return RawSource(path, dims_of(values.shape), values.dtype, values.offset, *lattice)
    return ArraySource(Grid(values, *lattice), path.name)


def open_nifti(path: Path, spacing: Triple | None, origin: Triple | None) -> ArraySource:
    """A NIfTI image, its axes permuted and flipped to the closest R, A, S; mapped if uncompressed.

    Raises:
        ArgumentError, ShapeError: if the file is damaged or no scalar volume.
    """
    import nibabel
    from nibabel.imageglobals import LoggingOutputSuppressor

    with reading_as("a NIfTI file"), LoggingOutputSuppressor():
        image = nibabel.load(path)
        if not isinstance(image, nibabel.Nifti1Image | nibabel.Nifti2Image):
            raise ArgumentError(f"expected a NIfTI image, got {type(image).__name__}")
        stored = image.get_data_dtype()
        if stored.fields:
            raise ArgumentError(f"expected a scalar volume, got {len(stored.fields)} components per sample")
        shape = image.shape[:3] + tuple(size for size in image.shape[3:] if size != 1)
        dims_of(shape)
        if stored.kind not in "biuf":
            raise ArgumentError(f"dtype: expected integers, floats or bool, got {stored}")
        turn = nibabel.io_orientation(image.affine)
        if np.isnan(turn).any():
            raise ArgumentError("expected three independent axes, got a singular affine matrix")
        proxy: Any = image.dataobj
        is_scaled = (proxy.slope, proxy.inter) != (1, 0)
        require_room(dims_of(shape[::-1]), np.dtype(np.float32) if is_scaled else stored)
        samples = np.asarray(proxy, np.float32) if is_scaled else np.asanyarray(proxy)
        values = nibabel.apply_orientation(samples.reshape(shape, order="F"), turn)  # [X, Y, Z]
        affine = image.affine @ nibabel.orientations.inv_ornt_aff(turn, shape)
    x, y, z = (float(step) for step in nibabel.affines.voxel_sizes(affine))
    first = (float(affine[0, 3]), float(affine[1, 3]), float(affine[2, 3]))
    return ArraySource(Grid(values.T, spacing or (x, y, z), origin or first), path.name)
