"""Images that SimpleITK reads, as lattice and samples."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import SimpleITK as sitk

from texgs.core.errors import ArgumentError
from texgs.volume.grid import Dims, byte_count, check_lattice, require_room
from texgs.volume.headers import NRRD, read_fields, spacing_in, unit_in
from texgs.volume.space import LEFT_HANDED, LETTERS, LPS, RAS, RIGHT_HANDED

# Our names for spaces of NRRD. ITK turns spaces with an anterior axis into LPS; we turn them back to RAS.
NRRD_SPACES = {
    **dict.fromkeys((RAS, "ras", "left-anterior-superior", "las"), RAS),
    **dict.fromkeys((LPS, "lps"), LPS),
    "scanner-xyz": "scanner-xyz",
    "3d-left-handed": LEFT_HANDED,
}
GIPL_HEADER = 256  # bytes before the samples
SOURCE_LINE = re.compile(r"^.*?(?:sitk::ERROR|ITK ERROR|itk::ERROR): (?:\w+\(0x[0-9a-f]+\): )?", re.DOTALL)


def read_itk(path: Path, is_header_only: bool) -> tuple[dict[str, Any], np.ndarray | None]:
    """Read the lattice in the file's own space, and samples [Z, Y, X] unless only the header is asked for."""
    sitk.ProcessObject.GlobalWarningDisplayOff()
    reader = sitk.ImageFileReader()
    reader.SetFileName(str(path))
    try:
        reader.ReadImageInformation()
        suffix, sizes = path.suffix.lower(), list(reader.GetSize())
        dims, dtype = require_volume(sizes, reader.GetPixelIDValue(), reader.GetNumberOfComponents())
        if suffix == ".gipl":
            expected, size = GIPL_HEADER + byte_count(dims, dtype), path.stat().st_size
            if size < expected:  # ITK would fill the rest with whatever is in memory
                raise ArgumentError(f"the file is cut off: expected {expected} bytes, found {size}")
        fields = read_fields(path)[0] if suffix in NRRD else {}
        space = NRRD_SPACES.get(fields.get("space", "").lower(), RIGHT_HANDED) if fields else LPS
        signs = np.array((-1.0, -1.0, 1.0) if space == RAS else (1.0, 1.0, 1.0))
        lattice: dict[str, Any] = {
            "dims": dims,
            "dtype": dtype.name,
            "spacing": reader.GetSpacing(),
            "origin": (np.array(reader.GetOrigin()) * signs + 0.0).tolist(),
            "directions": (np.reshape(reader.GetDirection(), (3, 3)).T * signs).tolist(),
            "space": space,
            "unit": unit_in(fields) or ("mm" if space in LETTERS else ""),
        }
        if upright := spacing_in(fields):
            lattice |= {"spacing": upright, "is_upright": True}
        if {"axismins", "axismaxs"} <= fields.keys() and "spacedirections" not in fields:
            lattice["origin"] = np.nan_to_num(np.array(fields["axismins"].split(), float)).tolist()
            if "spacings" not in fields:
                lattice["spacing"] = _steps(fields, dims)
        if is_header_only:
            return lattice, None
        require_room(dims, dtype)
        return lattice, sitk.GetArrayFromImage(reader.Execute())
    except RuntimeError as error:
        raise ArgumentError(sentence(error)) from error


def require_volume(
    sizes: list[int], pixel_id: int, n_components: int
) -> tuple[tuple[int, int, int], np.dtype]:
    """Require three axes of scalar samples, and return dims and sample type."""
    if n_components != 1:
        raise ArgumentError(f"expected a scalar volume, got {n_components} components per sample")
    if len(sizes) != 3:
        raise ArgumentError(f"expected 3 axes, got {len(sizes)}: sizes {sizes}")
    dtype = sitk.GetArrayViewFromImage(sitk.Image([1, 1, 1], pixel_id)).dtype
    dims = (sizes[0], sizes[1], sizes[2])
    check_lattice(dims, dtype)
    return dims, dtype


def _steps(fields: dict[str, str], dims: Dims) -> list[float]:
    """Return distances of samples by the ends of axes: places of the outer ones, or edges of cells."""
    low, high = (np.array(fields[name].split(), float) for name in ("axismins", "axismaxs"))
    words = fields.get("centerings", fields.get("centers", "node node node")).split()
    gaps = [size - (word != "cell") for size, word in zip(dims, words, strict=True)]
    steps = np.abs(high - low) / np.maximum(gaps, 1)
    return np.where(np.isfinite(steps), steps, 1.0).tolist()


def sentence(error: RuntimeError) -> str:
    """Return ITK's message without the location in its source."""
    return SOURCE_LINE.sub("", str(error).strip()).strip(" .!")
