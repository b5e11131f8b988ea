"""The process that reads a file of VTK: prints a line of JSON about it, and then the samples."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np

from texgs.core.errors import ArgumentError, OutOfMemoryError, TexgsError
from texgs.core.memory import free_memory
from texgs.volume.grid import dims_of, require_room


def main(path: Path) -> None:
    """Write to standard output what the file holds, or what is wrong with it."""
    with os.fdopen(os.dup(1), "wb") as output:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # what VTK prints is not for anybody
        limit_memory()
        try:
            said, values = image_of(path)
        except TexgsError as error:
            said, values = {"error": str(error), "is_memory": isinstance(error, OutOfMemoryError)}, None
        output.write(json.dumps(said).encode() + b"\n")
        if values is not None:
            output.write(memoryview(values.data).cast("B"))


def limit_memory() -> None:
    """Let this process have no more memory than there is; it would take the rest of the machine with it."""
    if sys.platform == "linux":
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
        _, most = resource.getrlimit(resource.RLIMIT_DATA)
        limit = used + free_memory()
        resource.setrlimit(resource.RLIMIT_DATA, (limit if most < 0 else min(limit, most), most))


def image_of(path: Path) -> tuple[dict[str, Any], np.ndarray]:
    """Lattice and samples [Z, Y, X] of image data.

    Raises:
        ArgumentError: if the file is damaged, or holds another kind of data set or no scalar field.
        OutOfMemoryError: if the samples do not fit into memory.
    """
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkCommonCore import vtkLogger, vtkOutputWindow, vtkStringOutputWindow
    from vtkmodules.vtkCommonDataModel import vtkImageData

    window = vtkStringOutputWindow()
    vtkOutputWindow.SetInstance(window)
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    reader = reader_of(path.suffix.lower())
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    check_claim(reader)
    reader.Update()
    image = reader.GetOutputDataObject(0)
    if message := first_message(window):
        raise ArgumentError(f"expected a {path.suffix} file, VTK says: {message}; is it damaged or cut off?")
    if not isinstance(image, vtkImageData):
        kind = image.GetClassName().removeprefix("vtk") if image else "nothing"
        raise ArgumentError(f"expected image data (structured points), got {kind}; resample it to an image")
    points = image.GetPointData()
    array = points.GetScalars() or points.GetArray(0)
    if array is None:
        raise ArgumentError("expected point data, found none; convert cell data to point data")
    if array.GetNumberOfComponents() != 1:
        n_components = array.GetNumberOfComponents()
        raise ArgumentError(f"expected a scalar volume, got {n_components} components per sample")
    shape = image.GetDimensions()[::-1]
    values = vtk_to_numpy(array)
    if values.size != np.prod(shape, dtype=np.int64):
        raise ArgumentError(
            f"expected image data of {list(shape)}, got {values.size} samples; is it damaged?"
        )
    first = [0.0, 0.0, 0.0]
    image.TransformIndexToPhysicalPoint(image.GetExtent()[::2], first)
    values = values.reshape(shape)
    lattice = {"spacing": image.GetSpacing(), "origin": first, "directions": directions_of(image)}
    return {**lattice, "dims": dims_of(shape), "dtype": values.dtype.str}, values


def directions_of(image: Any) -> list[list[float]]:
    """Directions of the axes, one after the other."""
    matrix = image.GetDirectionMatrix()  # in its columns
    return [[matrix.GetElement(row, axis) for row in range(3)] for axis in range(3)]


def reader_of(suffix: str) -> Any:
    """VTK reader of a format."""
    if suffix == ".vti":
        from vtkmodules.vtkIOXML import vtkXMLImageDataReader

        return vtkXMLImageDataReader()
    from vtkmodules.vtkIOLegacy import vtkGenericDataObjectReader

    return vtkGenericDataObjectReader()


def check_claim(reader: Any) -> None:
    """Require that what a header claims fits into memory; only headers of XML are read before samples."""
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as Pipeline

    information = reader.GetOutputInformation(0)
    if information is not None and information.Has(Pipeline.WHOLE_EXTENT()):
        extent = information.Get(Pipeline.WHOLE_EXTENT())
        sizes = [int(high) - int(low) + 1 for low, high in zip(extent[::2], extent[1::2], strict=True)]
        if min(sizes) > 0:
            require_room((sizes[0], sizes[1], sizes[2]), np.dtype(np.uint8))  # a byte each at least


def first_message(window: Any) -> str:
    """The first error or warning that VTK has printed instead of raising it; empty for none."""
    output = window.GetOutput()  # bytes where a damaged file is quoted that is no text
    text = output.decode(errors="replace") if isinstance(output, bytes) else output
    return next((sentence(message) for message in text.split("\n\n") if message.strip()), "")


def sentence(text: str) -> str:
    """A message without the place in VTK's source and the address of the object."""
    lines = [
        line
        for line in text.strip().splitlines()
        if not line.startswith(("ERROR: In", "Warning: In", "Generic Warning: In"))
    ]
    return " ".join(lines).split("): ", 1)[-1].strip(" .!")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
