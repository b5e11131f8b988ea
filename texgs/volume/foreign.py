"""Sources of the formats that SimpleITK and PyVista read, in a process of its own that runs this module.

Damaged files crash these libraries, or make them print instead of raising.
"""

import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from threading import Timer
from typing import IO, Any

import numpy as np

from texgs.core.errors import ArgumentError, OutOfMemoryError, TexgsError
from texgs.core.io import reading_as
from texgs.core.memory import free_memory
from texgs.volume.extra_axis import extra_axis, one_volume
from texgs.volume.grid import (
    AS_STORED,
    AxisPermutation,
    Dims,
    Grid,
    Triple,
    byte_count,
    closest,
    permuted_lattice,
    permuted_values,
    require_room,
)
from texgs.volume.headers import METAIMAGE, NRRD
from texgs.volume.samples import StoredSamples, stored_samples, unpack
from texgs.volume.slabs import ArraySource, RawSource, Source, step_note
from texgs.volume.space import LEFT_HANDED, RIGHT_HANDED, Space

VTK_SUFFIXES = (".vti", ".vtr", ".vts", ".pvti", ".pvtr", ".vtk", ".slc")
DICOM = (".dcm", ".ima")  # suffixes; slices may have none and are read by folder
MIN_SECONDS = 60.0  # least time limit for reading
BYTES_PER_SECOND = 1e6  # slowest accepted reading of a large file
MAX_LINE_BYTES = 1 << 20  # of the line before the samples
COMPLAINT = re.compile(r"error|fail|cannot|corrupt|unexpected", re.IGNORECASE)


def open_foreign(path: Path, spacing: Triple | None, origin: Triple | None, **keys: Any) -> Source:
    """Open image data with its axes along the closest ones of space, so that nothing is mirrored.

    Samples that are stored as in memory are read on demand, all others as a whole. Spacing and origin replace
    those of the file; `series` is the number or UID of one of several in a folder of DICOM slices, `time` the
    step of one that has several volumes, and `variable` the name of a point array of VTK's image data.
    """
    suffix, time = path.suffix.lower(), keys.get("time")
    with reading_as(_kind(path)):
        stored = stored_samples(path) if suffix in (*NRRD, *METAIMAGE) else None
        extra, index = extra_axis(path, time, keys.get("channel")) if stored is not None else (None, 0)
        with one_volume(path, extra) as header:
            reply, values = _ask(header, keys, is_header_only=stored is not None)
        nx, ny, nz = reply["dims"]
        dims, (axes, steps, first, space) = (nx, ny, nz), _lattice_of(reply, spacing, origin)
        if stored is not None:
            dtype = np.dtype(reply["dtype"]).newbyteorder(">" if stored.is_big_endian else "<")
            if (stored.encoding, axes, extra) == ("raw", AS_STORED, None):
                return _raw(stored, dims, dtype, steps, first, space)
            every = (nx, ny, nz * extra.size) if extra else dims
            is_raw = stored.encoding == "raw"
            values = _raw(stored, every, dtype).mapped() if is_raw else unpack(stored, every, dtype)
            if extra is not None:
                values = extra.picked(values, index)
                reply["n_steps"] = extra.size if extra.key == "time" else 1
        source = ArraySource(Grid(permuted_values(values, axes), steps, first, space=space), path.name)
        source.n_steps = reply.get("n_steps", 1)
        source.note = "; ".join(filter(None, (step_note(time or 0, source.n_steps), reply.get("note"))))
        return source


def _lattice_of(
    reply: dict[str, Any], spacing: Triple | None, origin: Triple | None
) -> tuple[AxisPermutation, Triple, Triple, Space]:
    """Return the permutation of stored axes closest to space, with spacing, origin and space along it."""
    directions, name = np.array(reply["directions"]), reply.get("space", RIGHT_HANDED)
    mirror = (-1.0, 1.0, 1.0) if name == LEFT_HANDED else (1.0, 1.0, 1.0)  # the world is right-handed
    axes = AS_STORED if reply.get("is_upright") else closest(directions * mirror)
    space = Space.along(directions, name, reply.get("unit", ""))
    steps = dict(enumerate(reply["spacing"]))
    steps |= {axis: step for (axis, _), step in zip(axes, spacing or (), strict=False)}
    stored = (steps[0], steps[1], steps[2])
    _, along, first, turned = permuted_lattice(reply["dims"], stored, reply["origin"], space, axes)
    return axes, along, origin or first, turned


def _raw(stored: StoredSamples, dims: Dims, dtype: np.dtype, *lattice: Any) -> RawSource:
    """Return samples as a source that reads them on demand; spacing, origin and space follow."""
    before = stored.offset if stored.offset >= 0 else stored.path.stat().st_size - byte_count(dims, dtype)
    return RawSource(stored.path, dims, dtype, before, *lattice)


def _kind(path: Path) -> str:
    """Describe the expected kind of a file, for messages."""
    return "a folder of DICOM slices" if path.is_dir() else f"a {path.suffix.lower()} file"


def _ask(path: Path, keys: dict[str, Any], is_header_only: bool) -> tuple[dict[str, Any], np.ndarray]:
    """Read a file in a process of its own; return its lattice and its samples [Z, Y, X]."""
    request = json.dumps({"path": str(path.absolute()), "keys": keys, "is_header_only": is_header_only})
    command = [sys.executable, "-P", "-m", "texgs.volume.foreign", request]
    size = sum(each.stat().st_size for each in (path.iterdir() if path.is_dir() else [path]))
    pipes = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    with subprocess.Popen(command, **pipes) as child:  # type: ignore[call-overload]
        watchdog = Timer(MIN_SECONDS + size / BYTES_PER_SECOND, child.kill)
        watchdog.start()
        try:
            reply, values = _receive(child.stdout, is_header_only)
        finally:
            watchdog.cancel()
            child.kill()
    if reply is None:
        raise ArgumentError(
            f"expected {_kind(path)}, but its reader broke off; it is damaged, or too large for memory"
        )
    if "error" in reply:
        raise (OutOfMemoryError if reply["is_memory"] else ArgumentError)(reply["error"])
    return reply, values


def _receive(stream: IO[bytes], is_header_only: bool) -> tuple[dict[str, Any] | None, np.ndarray]:
    """Return what the process says about a volume, None if it died, and the samples where it sends some."""
    reply = json.loads(stream.readline(MAX_LINE_BYTES) or "null")
    if reply is None or "error" in reply or is_header_only:
        return reply, np.empty(0)
    dims, dtype = reply["dims"], np.dtype(reply["dtype"])
    require_room(dims, dtype)
    samples = stream.read(byte_count(dims, dtype))
    is_whole = len(samples) == byte_count(dims, dtype)
    return (reply, np.frombuffer(samples, dtype).reshape(dims[::-1])) if is_whole else (None, np.empty(0))


def answer(path: Path, keys: dict[str, Any], is_header_only: bool) -> None:
    """Print a line of JSON with the lattice or the error, and then the samples; runs in the child."""
    with os.fdopen(os.dup(1), "wb") as output, tempfile.TemporaryFile("w+", errors="replace") as printed:
        os.dup2(printed.fileno(), 1)
        os.dup2(printed.fileno(), 2)
        limit_memory()
        values = None
        try:
            with reading_as(_kind(path)):
                reply, values = image_of(path, keys, is_header_only)
            printed.seek(0)  # errors that a library printed instead of raising
            for line in printed:
                if COMPLAINT.search(line) and "warning" not in line.lower():
                    raise ArgumentError(f"the file is damaged or cut off, its reader says: {line.strip()}")
        except TexgsError as error:
            values, reply = None, {"error": str(error), "is_memory": isinstance(error, OutOfMemoryError)}
        output.write(json.dumps(reply).encode() + b"\n")
        if values is not None:
            output.write(memoryview(np.ascontiguousarray(values).data).cast("B"))


def limit_memory() -> None:
    """Limit the memory of this process to what is free, so that a damaged file cannot stall the machine."""
    if sys.platform == "linux":
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
        _, most = resource.getrlimit(resource.RLIMIT_DATA)
        limit = used + free_memory()
        resource.setrlimit(resource.RLIMIT_DATA, (limit if most < 0 else min(limit, most), most))


def image_of(
    path: Path, keys: dict[str, Any], is_header_only: bool
) -> tuple[dict[str, Any], np.ndarray | None]:
    """Read the lattice, and samples [Z, Y, X] unless only the header is asked for."""
    if path.suffix.lower() in VTK_SUFFIXES:
        from texgs.volume.vtk_image import read_vtk

        return read_vtk(path, keys.get("variable"))
    from texgs.volume.dicom import read_dicom
    from texgs.volume.itk_image import read_itk

    if path.is_dir() or path.suffix.lower() in DICOM:
        return read_dicom(path, keys.get("series"), keys.get("time", 0))
    return read_itk(path, is_header_only)


if __name__ == "__main__":
    request = json.loads(sys.argv[1])
    answer(Path(request["path"]), request["keys"], request["is_header_only"])
