"""Text headers of NRRD and MetaImage files: their fields, and where the samples are."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import NamedTuple

from texgs.core.errors import ArgumentError
from texgs.core.names import named_file

NRRD, METAIMAGE = (".nrrd", ".nhdr"), (".mhd", ".mha")  # suffixes
NUMBERS = ("elementspacing", "elementsize", "offset", "position", "origin", "transformmatrix", "rotation")
ENCODINGS = {"raw": "raw", "gzip": "gzip", "gz": "gzip", "bzip2": "bzip2", "bz2": "bzip2"} | dict.fromkeys(
    ("ascii", "ASCII", "text", "txt"), "text"
)  # by NRRD's words
LONGEST_HEADER = 1 << 20  # bytes; a foreign file may hold no line break for gigabytes


class StoredSamples(NamedTuple):
    """Samples in a file."""

    path: Path
    offset: int  # bytes before them as they are stored; -1: they end the file
    skip: int  # bytes before them after decompression; -1: they end the stream
    encoding: str  # raw, zlib, gzip, bzip2 or text
    is_big_endian: bool


def read_fields(path: Path) -> tuple[dict[str, str], int]:
    """Read the fields of a header, and its length in bytes; names are in lower case and without spaces."""
    is_nrrd = path.suffix.lower() in NRRD
    with path.open("rb") as file:
        head = BytesIO(file.read(LONGEST_HEADER))
    if is_nrrd and not head.getvalue().startswith(b"NRRD"):
        raise ArgumentError("expected an NRRD file, but it does not start with NRRD")
    fields: dict[str, str] = {}
    while line := head.readline():
        name, separator, value = line.decode("utf-8", "surrogateescape").partition(":" if is_nrrd else "=")
        if is_nrrd and not line.strip():  # ends a header that samples follow
            break
        if separator and not value.startswith("="):  # NRRD's own pairs of key and value are for others
            fields[name.replace(" ", "").strip().lower()] = value.strip()
        if "elementdatafile" in fields:  # the last one
            break
    if head.tell() == LONGEST_HEADER:
        raise ArgumentError(f"expected a header of less than {LONGEST_HEADER} bytes, got a longer one")
    if not is_nrrd and "elementdatafile" not in fields:
        raise ArgumentError("expected a MetaImage file, found no ElementDataFile in its header")
    return fields, head.tell()


def samples_of(header: Path) -> Path | None:
    """Return the file with the samples of a header; None where it is no such header, or there is none."""
    if header.suffix.lower() not in (*NRRD, *METAIMAGE):
        return None
    try:
        path = _file_of(header, read_fields(header)[0])
        return path if path != header and path.is_file() else None
    except (OSError, ArgumentError):  # not there yet, or not for us: whoever reads it tells
        return None


def stored_samples(path: Path) -> StoredSamples | None:
    """Find the samples of a header; None where they are text of MetaImage."""
    fields, end = read_fields(path)
    samples = _file_of(path, fields)
    if not samples.is_file():
        raise ArgumentError(f"no such file with samples: {samples}")
    offset = end if samples == path else 0
    if path.suffix.lower() in METAIMAGE:
        for name in NUMBERS:  # ITK takes 1 where a word is no number
            _ = [float(word) for word in fields.get(name, "").split()]
        is_big = _is_true(fields, "binarydatabyteordermsb") or _is_true(fields, "elementbyteordermsb")
        offset = int(fields.get("headersize", "0")) or offset
        encoding = "zlib" if _is_true(fields, "compresseddata") else "raw"
        is_text = "binarydata" in fields and not _is_true(fields, "binarydata")
        return None if is_text else StoredSamples(samples, offset, 0, encoding, is_big)
    encoding = ENCODINGS.get(fields["encoding"], "")
    if not encoding:
        raise ArgumentError(f"encoding: expected raw, gzip, bzip2 or ascii, got {fields['encoding']}")
    skip = int(fields.get("byteskip", "0"))
    with samples.open("rb") as file:
        file.seek(offset)
        for _ in range(int(fields.get("lineskip", "0"))):
            if not file.readline():
                raise ArgumentError("line skip: expected no more lines than the file has")
        offset = file.tell()
    if encoding == "raw":
        offset, skip = -1 if skip == -1 else offset + skip, 0
    is_big = fields.get("endian") == "big"
    return StoredSamples(samples, offset, skip, encoding, is_big)


def _is_true(fields: dict[str, str], name: str) -> bool:
    """Whether a field of MetaImage says yes."""
    return fields.get(name, "").lower() in ("true", "1")


def _file_of(header: Path, fields: dict[str, str]) -> Path:
    """The file with the samples, which may be that of the header."""
    key = "datafile" if header.suffix.lower() in NRRD else "elementdatafile"
    name = fields.get(key, "LOCAL")
    if name.upper() == "LOCAL":
        return header
    if name.startswith("LIST") or "%" in name:
        raise ArgumentError(f"expected one file of samples, got one per slice ({key}: {name}); join them")
    return named_file(key, header.parent, name)
