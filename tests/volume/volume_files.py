"""One small volume, written in every format by the library that knows the format best."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

SPACING = (0.5, 2.0, 3.0)


def sample_values(dtype: str = "uint16") -> np.ndarray:
    """[11, 12, 13], all axes different; some bytes that look like line breaks and ends of text."""
    return np.random.default_rng(0).integers(0, 100, (11, 12, 13)).astype(dtype)


def image_data(values: np.ndarray):
    """VTK image with one point array."""
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonDataModel import vtkImageData

    image = vtkImageData()
    image.SetDimensions(values.shape[2], values.shape[1], values.shape[0])
    image.SetSpacing(*SPACING)
    array = numpy_to_vtk(values.reshape(-1, *values.shape[3:]), deep=True)
    array.SetName("density")
    image.GetPointData().SetScalars(array)
    return image


def write_vti(path: Path, values: np.ndarray) -> None:
    from vtkmodules.vtkIOXML import vtkXMLImageDataWriter

    writer = vtkXMLImageDataWriter()
    if path.stem == "plain":
        writer.SetCompressorTypeToNone()
        writer.EncodeAppendedDataOff()
    _write(writer, path, values)


def write_vtk(path: Path, values: np.ndarray) -> None:
    from vtkmodules.vtkIOLegacy import vtkStructuredPointsWriter

    writer = vtkStructuredPointsWriter()
    if path.stem == "binary":
        writer.SetFileTypeToBinary()
    _write(writer, path, values)


def write_meta(path: Path, values: np.ndarray) -> None:
    from vtkmodules.vtkIOImage import vtkMetaImageWriter

    writer = vtkMetaImageWriter()
    writer.SetCompression(path.stem == "compressed")
    _write(writer, path, values)


def _write(writer, path: Path, values: np.ndarray) -> None:
    writer.SetInputData(image_data(values))
    writer.SetFileName(str(path))
    writer.Write()


def write_nrrd(path: Path, values: np.ndarray) -> None:
    import nrrd

    header = {"encoding": path.stem, "spacings": list(SPACING)}
    nrrd.write(str(path), values, header, index_order="C")


def write_nifti(path: Path, values: np.ndarray) -> None:
    import nibabel

    nibabel.save(nibabel.Nifti1Image(values.T, np.diag([*SPACING, 1.0])), path)


def write_tiff(path: Path, values: np.ndarray) -> None:
    import tifffile

    options = {"little": {}, "big": {"byteorder": ">"}, "packed": {"compression": "zlib"}}
    tifffile.imwrite(path, values, **options[path.stem])


def write_npy(path: Path, values: np.ndarray) -> None:
    np.save(path, np.asfortranarray(values) if path.stem == "columns" else values)


# File name: how to write it. The stem chooses the variant.
WRITERS: dict[str, Callable[[Path, np.ndarray], None]] = {
    "packed.vti": write_vti,
    "plain.vti": write_vti,
    "text.vtk": write_vtk,
    "binary.vtk": write_vtk,
    "plain.mha": write_meta,
    "compressed.mha": write_meta,
    "plain.mhd": write_meta,
    "compressed.mhd": write_meta,
    "raw.nrrd": write_nrrd,
    "gzip.nrrd": write_nrrd,
    "bzip2.nrrd": write_nrrd,
    "ascii.nrrd": write_nrrd,
    "raw.nhdr": write_nrrd,
    "gzip.nhdr": write_nrrd,
    "plain.nii": write_nifti,
    "packed.nii.gz": write_nifti,
    "little.tif": write_tiff,
    "big.tiff": write_tiff,
    "packed.tif": write_tiff,
    "rows.npy": write_npy,
    "columns.npy": write_npy,
}
HAS_SPACING = tuple(name for name in WRITERS if not name.endswith((".tif", ".tiff", ".npy")))
