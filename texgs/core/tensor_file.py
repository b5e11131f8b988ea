"""Files of tensors: safetensors with what belongs to them as JSON in the header, and torch's, to read.

The header has one entry, whose name is that of the format: safetensors keeps no order of entries. Files are
written in one step and without a copy of the tensors in memory: the library writes either to bytes, which for
the checkpoint of a grid is most of a fit's memory, or to a file that it opens itself, of which nobody can say
when it is whole.
"""

import json
import pickle
import pickletools
import warnings
from collections.abc import Iterator, Mapping
from itertools import repeat
from pathlib import Path
from typing import IO, Any, BinaryIO
from zipfile import ZipFile, is_zipfile

import torch
from torch import Tensor

from texgs.core.errors import ArgumentError
from texgs.core.io import reading, write_atomic

DTYPES = {
    torch.float64: "F64",
    torch.int64: "I64",
    torch.float32: "F32",
    torch.int32: "I32",
    torch.float16: "F16",
    torch.int16: "I16",
    torch.uint8: "U8",
    torch.bool: "BOOL",
}
ALIGNMENT = 8  # bytes
MAX_TEXT_LETTERS = 1000  # letters of a text in a pickle; torch's search for a cause takes the square of it
OLD_PICKLES = 5  # one after the other at the start of a file of torch before 1.6


def write_tensor_file(
    path: str | Path, format: str, description: Mapping[str, Any], tensors: Mapping[str, Tensor]
) -> Path:
    """Create or replace a file of a format in one step; the same contents give the same bytes.

    The description is JSON with a `version`, and `metadata` of the caller's.
    """
    require_json(path, description)
    return write_tensors(path, tensors, {format: json.dumps(description)})


def write_tensors(
    path: str | Path, tensors: Mapping[str, Tensor], metadata: Mapping[str, str] | None = None
) -> Path:
    """Create or replace a safetensors file of tensors of `DTYPES`; the same tensors give the same bytes."""
    # Large elements first, so that all lie at multiples of their size, as readers want it.
    ordered = sorted(tensors.items(), key=lambda item: (-item[1].element_size(), item[0]))
    header: dict[str, object] = {"__metadata__": dict(metadata)} if metadata else {}
    end = 0
    for name, x in ordered:
        start, end = end, end + x.numel() * x.element_size()
        header[name] = {"dtype": DTYPES[x.dtype], "shape": list(x.shape), "data_offsets": [start, end]}
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % ALIGNMENT)

    def write(file: BinaryIO) -> None:
        file.write(len(text).to_bytes(8, "little") + text)
        for _, x in ordered:
            file.write(x.detach().cpu().contiguous().numpy().reshape(-1).data)

    return write_atomic(path, write)


def require_json(path: str | Path, description: Mapping[str, Any]) -> None:
    """Require a description that JSON can hold; all but the metadata is ours."""
    try:
        json.dumps(description, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise ArgumentError(f"{path}: metadata cannot be written as JSON: {error}") from error


def read_tensor_file(path: Path, format: str, version: int) -> tuple[dict[str, Any], dict[str, Tensor]]:
    """Return the description and tensors, bit for bit, on the CPU. Nothing in the file is executed.

    The description is judged before any tensor is looked at; the version is the newest that can be read.
    """
    from safetensors import safe_open

    advice = "it is cut short or damaged, or of another format: check the path, or copy or write it again"
    with reading(path, f"a {format} file", advice), safe_open(path, framework="pt") as file:
        description = _description(path, format, version, file.metadata() or {})
        # A copy is aligned in memory and does not depend on the file any more.
        return description, {name: file.get_tensor(name).clone() for name in file.keys()}  # noqa: SIM118


def _description(path: Path, format: str, newest: int, header: dict[str, str]) -> dict[str, Any]:
    """Return the description in a header, of a version that can be read."""
    if format not in header:
        raise ArgumentError(f"{path}: expected a {format} file, got safetensors of another program")
    try:
        description: dict[str, Any] = json.loads(header[format])
        version = int(str(description["version"]))
    except (KeyError, RecursionError, TypeError, ValueError) as error:
        raise ArgumentError(
            f"{path}: expected JSON with a version in the header, got {header[format]!r:.120}; "
            "write the file again"
        ) from error
    if version > newest:
        raise ArgumentError(
            f"{path}: expected version {newest} of the format at most, got {version}; update texgs"
        )
    return description


def load_torch(path: Path) -> Any:
    """Return what torch.load makes of a file, on the CPU, without running anything that it may hold.

    A file of more than tensors, lists, tables, numbers and text is a ValueError.
    """
    is_zip = is_zipfile(path)
    for pickled in _pickles(path, is_zip):
        for _, argument, _ in pickletools.genops(pickled):
            if isinstance(argument, str | bytes) and len(argument) > MAX_TEXT_LETTERS:
                raise ValueError(f"a text of {len(argument)} letters")  # that no name of a tensor has
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of unusual pickles
            return torch.load(path, map_location="cpu", weights_only=True, mmap=is_zip)
    except pickle.UnpicklingError as error:
        raise ValueError("what torch cannot read without running code in it") from error


def _pickles(path: Path, is_zip: bool) -> Iterator[IO[bytes]]:
    """Yield the pickles in a file of torch, each at its start."""
    if not is_zip:
        with path.open("rb") as file:
            yield from repeat(file, OLD_PICKLES)
        return
    with ZipFile(path) as archive:
        for name in archive.namelist():
            if name.endswith("data.pkl"):
                with archive.open(name) as file:
                    yield file
