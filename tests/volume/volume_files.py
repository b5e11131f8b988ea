"""One small volume, written in every format by the library that knows the format best."""

from collections.abc import Callable
from pathlib import Path

import h5py
import nibabel
import nrrd
import numpy as np
import pytest
import pyvista
import tifffile
from vtkmodules.vtkIOImage import vtkMetaImageWriter
from vtkmodules.vtkIOLegacy import vtkStructuredPointsWriter
from vtkmodules.vtkIOXML import vtkXMLImageDataWriter

from texgs.volume.sources import open_source

Writer = Callable[[Path, np.ndarray], None]
SPACING = (0.5, 2.0, 3.0)


def sample_values(dtype: str = "uint16") -> np.ndarray:
    """[11, 12, 13], all axes different; some bytes that look like line breaks and ends of text."""
    return np.random.default_rng(0).integers(0, 100, (11, 12, 13)).astype(dtype)


def whole(path: Path, **arguments) -> np.ndarray:
    """Open a file and decode all of it."""
    source = open_source(path, **arguments)
    return source.slices(0, source.dims[2])


def assert_holds(path: Path, values: np.ndarray, spacing=None, origin=None, **arguments) -> None:
    """Compare samples with values, and spacing and origin where they are given."""
    source = open_source(path, **arguments)
    np.testing.assert_array_equal(source.slices(0, source.dims[2]), values)
    assert (source.spacing, source.origin) == (spacing or source.spacing, origin or source.origin)


def image_data(values: np.ndarray) -> pyvista.ImageData:
    """VTK image with one point array."""
    image = pyvista.ImageData(dimensions=values.shape[2::-1], spacing=SPACING)
    image["density"] = values.reshape(-1, *values.shape[3:])
    return image


def write_image(path: Path, image: pyvista.ImageData, kind=vtkXMLImageDataWriter, **settings) -> None:
    """Write an image by a writer of VTK; settings are the arguments of its setters."""
    writer = kind()
    for name, value in settings.items():
        getattr(writer, f"Set{name}")(value)
    writer.SetInputData(image)
    writer.SetFileName(str(path))
    writer.Write()


def by_vtk(kind, **settings) -> Writer:
    return lambda path, values: write_image(path, image_data(values), kind, **settings)


def by_nrrd(encoding: str) -> Writer:
    header = {"encoding": encoding, "spacings": list(SPACING)}
    return lambda path, values: nrrd.write(str(path), values, header, index_order="C")


def by_tifffile(**options) -> Writer:
    return lambda path, values: tifffile.imwrite(path, values, **options)


def by_nibabel(kind=nibabel.Nifti1Image) -> Writer:
    return lambda path, values: nibabel.save(kind(values.T, np.diag([*SPACING, 1.0])), path)


def by_h5py(path: Path, values: np.ndarray) -> None:
    with h5py.File(path, "w") as file:
        file["density"] = values


def write_slc(path: Path, values: np.ndarray) -> None:
    """Write samples of 8 bits, a run for each row where the name says that they are packed."""
    values, is_packed = values.astype("u1"), path.name.startswith("packed")
    text = f"11111 13 12 11 8 1.0 1.0 2.0 1 0 0 {int(is_packed)} 2 2 X".encode() + bytes(12)
    for plane in values:
        runs = b"".join(bytes([0x80 | len(row)]) + row.tobytes() for row in plane) + b"\x00"
        text += f"{len(runs)} X".encode() + runs if is_packed else plane.tobytes()
    path.write_bytes(text)


def page_by_page(path: Path, values: np.ndarray) -> None:
    with tifffile.TiffWriter(path) as writer:
        for page in values:
            writer.write(page, compression="zlib", contiguous=False)


WRITERS: dict[str, Writer] = {
    "packed.vti": by_vtk(vtkXMLImageDataWriter),
    "plain.vti": by_vtk(vtkXMLImageDataWriter, Compressor=None, EncodeAppendedData=False),
    "text.vtk": by_vtk(vtkStructuredPointsWriter),
    "binary.vtk": by_vtk(vtkStructuredPointsWriter, FileType=2),
    "plain.mha": by_vtk(vtkMetaImageWriter, Compression=False),
    "compressed.mha": by_vtk(vtkMetaImageWriter, Compression=True),
    "plain.mhd": by_vtk(vtkMetaImageWriter, Compression=False),
    "compressed.mhd": by_vtk(vtkMetaImageWriter, Compression=True),
    **{f"{encoding}.nrrd": by_nrrd(encoding) for encoding in ("raw", "gzip", "bzip2", "ascii")},
    "raw.nhdr": by_nrrd("raw"),
    "gzip.nhdr": by_nrrd("gzip"),
    "plain.nii": by_nibabel(),
    "second.nii": by_nibabel(nibabel.Nifti2Image),
    "packed.nii.gz": by_nibabel(),
    "little.tif": by_tifffile(),
    "big.tiff": by_tifffile(byteorder=">"),
    "packed.tif": by_tifffile(compression="zlib"),
    "pages.tif": page_by_page,
    "rows.npy": np.save,
    "array.h5": by_h5py,
    "columns.npy": lambda path, values: np.save(path, np.asfortranarray(values)),
}
# Endings of files that a process of its own reads, in half a second or more; `make test` leaves these out.
BY_A_PROCESS = (".vti", ".vtk", ".mha", ".mhd", ".nrrd", ".nhdr")
NAMES = [
    pytest.param(name, marks=pytest.mark.subprocess) if name.endswith(BY_A_PROCESS) else name
    for name in WRITERS
]
READ_ON_DEMAND = ("plain.mha", "plain.mhd", "raw.nrrd", "raw.nhdr", "little.tif", "big.tiff", "rows.npy")
HAS_SPACING = tuple(name for name in WRITERS if not name.endswith((".tif", ".tiff", ".npy", ".h5")))
