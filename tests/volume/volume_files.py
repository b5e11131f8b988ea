"""One small volume, written in every format by the library that knows the format best."""

from collections.abc import Callable
from pathlib import Path

import nibabel
import nrrd
import numpy as np
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


def by_nibabel(path: Path, values: np.ndarray) -> None:
    nibabel.save(nibabel.Nifti1Image(values.T, np.diag([*SPACING, 1.0])), path)


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
    "plain.nii": by_nibabel,
    "packed.nii.gz": by_nibabel,
    "little.tif": by_tifffile(),
    "big.tiff": by_tifffile(byteorder=">"),
    "packed.tif": by_tifffile(compression="zlib"),
    "rows.npy": np.save,
    "columns.npy": lambda path, values: np.save(path, np.asfortranarray(values)),
}
HAS_SPACING = tuple(name for name in WRITERS if not name.endswith((".tif", ".tiff", ".npy")))
