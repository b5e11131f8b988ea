"""NIfTI images as sources, by nibabel: ITK knows neither NIfTI-2 nor axes that are not at right angles."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.core.io import reading_as
from texgs.volume.grid import Grid, Triple, dims_of, require_room
from texgs.volume.slabs import ArraySource


def open_nifti(path: Path, spacing: Triple | None, origin: Triple | None) -> ArraySource:
    """Open a NIfTI image, its axes permuted and flipped to the closest R, A, S; mapped if uncompressed."""
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
