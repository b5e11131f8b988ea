"""Images that SimpleITK reads, as lattice and samples."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import SimpleITK as sitk

from texgs.core.errors import ArgumentError
from texgs.volume.grid import check_lattice, require_room
from texgs.volume.headers import NRRD, read_fields

ONES, ZEROS = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
# ITK's space runs to the left and the back, that of NIfTI and some NRRD files to the right and the front.
TO_RIGHT_FRONT = (-1.0, -1.0, 1.0)
NRRD_SPACES = {
    "right-anterior-superior": TO_RIGHT_FRONT,
    "ras": TO_RIGHT_FRONT,
    "left-anterior-superior": TO_RIGHT_FRONT,
    "las": TO_RIGHT_FRONT,
    "3d-left-handed": (-1.0, 1.0, 1.0),
}
SOURCE_LINE = re.compile(r"^.*?(?:sitk::ERROR|ITK ERROR): (?:\w+\(0x[0-9a-f]+\): )?", re.DOTALL)


def read_itk(path: Path, is_header_only: bool) -> tuple[dict[str, Any], np.ndarray | None]:
    """Read the lattice in the file's own space, and samples [Z, Y, X] unless only the header is asked for.

    Raises:
        ArgumentError: if ITK cannot read the file, or it holds something else than a scalar volume.
        OutOfMemoryError: if the samples do not fit into memory.
    """
    sitk.ProcessObject.GlobalWarningDisplayOff()
    reader = sitk.ImageFileReader()
    reader.SetFileName(str(path))
    try:
        reader.ReadImageInformation()
        sizes = list(reader.GetSize())
        while len(sizes) > 3 and sizes[-1] == 1:  # one step of time
            sizes.pop()
        dims, dtype = require_volume(sizes, reader.GetPixelIDValue(), reader.GetNumberOfComponents())
        said = lattice_of(reader, np.array(signs_of(path)))
        if is_header_only:
            return said | {"dims": dims, "dtype": dtype.name}, None
        if reader.GetDimension() > 3:
            reader.SetExtractSize([*sizes, *([0] * (reader.GetDimension() - 3))])
        image = reader.Execute()
    except RuntimeError as error:
        raise ArgumentError(sentence(error)) from error
    values = sitk.GetArrayFromImage(image)
    return said | {"dims": dims, "dtype": values.dtype.name}, values


def require_volume(
    sizes: list[int], pixel_id: int, n_components: int
) -> tuple[tuple[int, int, int], np.dtype]:
    """Require three axes of scalar samples that fit into memory, and return dims and sample type.

    Raises:
        ArgumentError: if there are other axes or components, or samples are no real numbers.
        OutOfMemoryError: naming the size that the header claims.
    """
    if n_components != 1:
        raise ArgumentError(f"expected a scalar volume, got {n_components} components per sample")
    if len(sizes) != 3:
        raise ArgumentError(f"expected 3 axes, got {len(sizes)}: sizes {sizes}")
    dtype = sitk.GetArrayViewFromImage(sitk.Image([1, 1, 1], pixel_id)).dtype
    dims = (sizes[0], sizes[1], sizes[2])
    check_lattice(dims, dtype, ONES, ZEROS)
    require_room(dims, dtype)
    return dims, dtype


def signs_of(path: Path) -> tuple[float, float, float]:
    """Signs that turn ITK's space into that of the file; NIfTI's runs to the right, to the front and up."""
    if path.suffix.lower() not in NRRD:
        return TO_RIGHT_FRONT if path.name.lower().endswith((".nii", ".nii.gz")) else ONES
    return NRRD_SPACES.get(read_fields(path)[0].get("space", "").lower(), ONES)


def lattice_of(image: Any, signs: np.ndarray) -> dict[str, Any]:
    """Return spacing, origin and directions of a volume, which may have more axes."""
    n = image.GetDimension()
    directions = np.reshape(image.GetDirection(), (n, n))[:3, :3].T * signs
    return {
        "spacing": image.GetSpacing()[:3],
        "origin": (np.array(image.GetOrigin()[:3]) * signs + 0.0).tolist(),
        "directions": directions.tolist(),
    }


def sentence(error: RuntimeError) -> str:
    """Return what ITK says without the place in its source."""
    return SOURCE_LINE.sub("", str(error).strip()).strip(" .!")
