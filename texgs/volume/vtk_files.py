"""VTK's own formats as sources, read as a whole by VTK."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from texgs.core.errors import ArgumentError
from texgs.volume.grid import Grid, Triple
from texgs.volume.slabs import ArraySource, reading_as

TAIL = 1024  # bytes; more than the end tag and whatever blanks an editor left behind it


def open_vtk(path: Path, spacing: Triple | None, origin: Triple | None) -> ArraySource:
    """Image data with its scalars, or its first point array where none are marked as such.

    Raises:
        ArgumentError: if the file is damaged, or holds another kind of data set or no scalar field.
    """
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkCommonDataModel import vtkImageData

    _check_end(path)
    reader = _reader(path.suffix.lower())
    reader.SetFileName(str(path))
    with _vtk_messages() as messages:
        reader.Update()
        image = reader.GetOutputDataObject(0)
    if messages:
        raise ArgumentError(
            f"expected a {path.suffix} file, VTK says: {messages[0]}; is it damaged or cut off?"
        )
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
    with reading_as("image data"):
        values = vtk_to_numpy(array).reshape(image.GetDimensions()[::-1])
    first = [0.0, 0.0, 0.0]
    image.TransformIndexToPhysicalPoint(image.GetExtent()[::2], first)
    return ArraySource(
        Grid(values, spacing or image.GetSpacing(), origin or (first[0], first[1], first[2])), path.name
    )


def _check_end(path: Path) -> None:
    """Refuse an XML file that is cut off: VTK reads uncompressed samples past its end without a word."""
    if path.suffix.lower() != ".vti":
        return
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - TAIL))
        if b"</VTKFile>" not in file.read():
            raise ArgumentError("the file is cut off or no .vti file: expected </VTKFile> at its end")


def _reader(suffix: str) -> Any:
    """VTK reader of a format."""
    if suffix == ".vti":
        from vtkmodules.vtkIOXML import vtkXMLImageDataReader

        return vtkXMLImageDataReader()
    from vtkmodules.vtkIOLegacy import vtkGenericDataObjectReader

    return vtkGenericDataObjectReader()


@contextmanager
def _vtk_messages() -> Iterator[list[str]]:
    """Collect VTK's errors and warnings, which it prints instead of raising them.

    Both its output window and its logger write to the terminal; both are as before afterwards.
    """
    from vtkmodules.vtkCommonCore import vtkLogger, vtkOutputWindow, vtkStringOutputWindow

    messages: list[str] = []
    window, before = vtkStringOutputWindow(), vtkOutputWindow.GetInstance()
    verbosity = vtkLogger.GetCurrentVerbosityCutoff()
    vtkOutputWindow.SetInstance(window)
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    try:
        yield messages
    finally:
        vtkLogger.SetStderrVerbosity(verbosity)
        vtkOutputWindow.SetInstance(before)
        output = window.GetOutput()  # bytes where a damaged file is quoted that is no text
        text = output.decode(errors="replace") if isinstance(output, bytes) else output
        messages += [_sentence(message) for message in text.split("\n\n") if message.strip()]


def _sentence(text: str) -> str:
    """A message without the place in VTK's source and the address of the object."""
    lines = [
        line
        for line in text.strip().splitlines()
        if not line.startswith(("ERROR: In", "Warning: In", "Generic Warning: In"))
    ]
    return " ".join(lines).split("): ", 1)[-1].strip(" .!")
