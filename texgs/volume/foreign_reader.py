"""The process that reads a foreign file: prints a line of JSON about it, and then the samples."""

from __future__ import annotations

import json
import os
import re
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from texgs.core.errors import ArgumentError, OutOfMemoryError, TexgsError
from texgs.core.io import reading_as
from texgs.core.memory import free_memory

COMPLAINT = re.compile(r"error|fail|cannot|corrupt|unexpected", re.IGNORECASE)
BY_VTK = (".vti", ".vtk", ".slc")


def main(request: dict[str, Any]) -> None:
    """Write to standard output what the file holds, or what is wrong with it."""
    path, is_header_only = Path(request["path"]), request["is_header_only"]
    with os.fdopen(os.dup(1), "wb") as output, tempfile.TemporaryFile("w+", errors="replace") as printed:
        os.dup2(printed.fileno(), 1)
        os.dup2(printed.fileno(), 2)
        limit_memory()
        values = None
        try:
            with reading_as("a folder of DICOM slices" if path.is_dir() else f"a {path.suffix} file"):
                said, values = image_of(path, request["series"], is_header_only)
            printed.seek(0)
            complain(printed.read())
        except TexgsError as error:
            values, said = None, {"error": str(error), "is_memory": isinstance(error, OutOfMemoryError)}
        output.write(json.dumps({**said, "is_header_only": is_header_only}).encode() + b"\n")
        if values is not None:
            output.write(memoryview(np.ascontiguousarray(values).data).cast("B"))


def limit_memory() -> None:
    """Let this process have no more memory than there is; it would take the rest of the machine with it."""
    if sys.platform == "linux":
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
        _, most = resource.getrlimit(resource.RLIMIT_DATA)
        limit = used + free_memory()
        resource.setrlimit(resource.RLIMIT_DATA, (limit if most < 0 else min(limit, most), most))


def image_of(
    path: Path, series: str | None, is_header_only: bool
) -> tuple[dict[str, Any], np.ndarray | None]:
    """Read the lattice, and samples [Z, Y, X] unless only the header is asked for."""
    if path.suffix.lower() in BY_VTK:
        from texgs.volume.vtk_image import read_vtk

        return read_vtk(path)
    if path.is_dir():
        from texgs.volume.dicom import read_dicom

        return read_dicom(path, series)
    from texgs.volume.itk_image import read_itk

    return read_itk(path, is_header_only)


def complain(printed: str) -> None:
    """Raise what a library has printed instead of raising it."""
    for line in printed.splitlines():
        if COMPLAINT.search(line) and "warning" not in line.lower():
            raise ArgumentError(f"the file is damaged or cut off, its reader says: {line.strip()}")


if __name__ == "__main__":
    main(json.loads(sys.argv[1]))
