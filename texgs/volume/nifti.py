"""NIfTI, ANALYZE and MGH, by nibabel: ITK knows neither NIfTI-2 nor axes that are not at right angles."""

from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from texgs.core.errors import ArgumentError, TexgsError
from texgs.core.io import reading_as
from texgs.volume.axes import Axis, place_on
from texgs.volume.grid import Grid, Triple, check_lattice, dims_of, require_room
from texgs.volume.slabs import ArraySource, Source, step_note
from texgs.volume.space import RAS, RIGHT_HANDED, Space

NIBABEL_SUFFIXES = (".nii", ".nii.gz", ".hdr", ".img", ".mgh", ".mgz")
ORIENTATION_FIELDS = ("sform_code", "qform_code", "goodRASFlag")  # fields of headers; 0: no orientation
UNITS = {"meter": "m", "micron": "um"}  # default mm


def open_nifti(path: Path, spacing: Triple | None, origin: Triple | None, time: int = 0) -> Source:
    """Open an image of NIfTI, ANALYZE or MGH, its axes permuted and flipped to the closest R, A, S.

    It is mapped if it is not compressed, and of several along a fourth axis one step is read.
    """
    import nibabel
    from nibabel.imageglobals import LoggingOutputSuppressor

    with reading_as("a NIfTI file"), LoggingOutputSuppressor():
        image = nibabel.load(path)
        if not isinstance(image, nibabel.AnalyzeImage | nibabel.MGHImage):  # NIfTI is a subclass of ANALYZE
            raise ArgumentError(f"expected a NIfTI image, got {type(image).__name__}")
        stored = image.get_data_dtype()
        if stored.fields:
            raise ArgumentError(f"expected a scalar volume, got {len(stored.fields)} components per sample")
        n_steps, *rest = image.shape[3:] or (1,)
        place_on(Axis("time", n_steps), time)
        shape = image.shape[:3] + tuple(size for size in rest if size != 1)
        x, y, z = dims_of(shape)[::-1]
        check_lattice((x, y, z), stored)
        told, name, unit, remark = _space_of(image)
        turn = nibabel.io_orientation(told)
        if np.isnan(turn).any():
            raise ArgumentError("expected three independent axes, got a singular affine matrix")
        proxy: Any = image.dataobj
        is_scaled = (proxy.slope, proxy.inter) != (1, 0)
        proxy = proxy[..., time, *[0] * len(rest)] if n_steps > 1 else proxy  # reads this step only
        require_room((x, y, z), np.dtype(np.float32) if is_scaled else stored)
        samples = np.asarray(proxy, np.float32) if is_scaled else np.asanyarray(proxy)
        values = nibabel.apply_orientation(samples.reshape(shape, order="F"), turn)  # [X, Y, Z]
        affine = told @ nibabel.orientations.inv_ornt_aff(turn, shape)
    dx, dy, dz = (float(step) for step in nibabel.affines.voxel_sizes(affine))
    first = (float(affine[0, 3]), float(affine[1, 3]), float(affine[2, 3]))
    space = Space.along(affine[:3, :3].T, name, unit)
    source = ArraySource(Grid(values.T, spacing or (dx, dy, dz), origin or first, space=space), path.name)
    source.n_steps, source.note = n_steps, "; ".join(filter(None, (step_note(time, n_steps), remark)))
    return source


def is_label_image(path: Path) -> bool:
    """Return whether the header of an image of NIfTI says that samples are labels."""
    import nibabel

    with suppress(TexgsError), reading_as("a NIfTI file"):  # who reads its samples will say more
        image = nibabel.load(path)
        return isinstance(image, nibabel.Nifti1Pair) and image.header.get_intent()[0] == "label"
    return False


def _space_of(image: Any) -> tuple[np.ndarray, str, str, str]:
    """Return the matrix [4, 4] from indices to space, its name and unit, and a note on missing facts."""
    from nibabel import Nifti1Pair

    header, is_nifti = image.header, isinstance(image, Nifti1Pair)
    unit = UNITS.get(header.get_xyzt_units()[0], "mm") if is_nifti else "mm"
    if any(int(header[name]) for name in ORIENTATION_FIELDS if name in header):
        return image.affine, RAS, unit, ""
    # Method 1 of the standard: nibabel would mirror x.
    matrix, kind = np.diag([*header.get_zooms()[:3], 1.0]), "NIfTI" if is_nifti else "ANALYZE"
    return matrix, RIGHT_HANDED, unit, f"{kind} tells no orientation: axes are taken as stored"
