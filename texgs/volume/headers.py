"""Text headers of NRRD and MetaImage files, their sample files, and placeholders instead of files."""

from __future__ import annotations

import re
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from texgs.core.errors import ArgumentError
from texgs.core.names import named_file

if TYPE_CHECKING:
    from texgs.volume.space import Triple

NRRD, METAIMAGE = (".nrrd", ".nhdr"), (".mhd", ".mha")  # suffixes
UPRIGHT_SPACING = "uprightspacing"  # our own key: spacing of axes already turned so that +y is up
UNIT = re.compile(r'"([^"]*)"')
ANALYZE = (".hdr", ".img")  # two files of ANALYZE or NIfTI; either may be given
MAX_HEADER_BYTES = 1 << 20  # bytes; a foreign file may hold no line break for gigabytes

LFS, PAGES = (
    b"version https://git-lfs",
    (b"<!doctype html", b"<html"),
)  # first bytes of files that replace the real one


def read_fields(path: Path) -> tuple[dict[str, str], int]:
    """Read the fields of a header, and its length in bytes; names are in lower case and without spaces."""
    is_nrrd = path.suffix.lower() in NRRD
    with path.open("rb") as file:
        head = BytesIO(file.read(MAX_HEADER_BYTES))
    if is_nrrd and not head.getvalue().startswith(b"NRRD"):
        raise ArgumentError("expected an NRRD file, but it does not start with NRRD")
    fields: dict[str, str] = {}
    while line := head.readline():
        name, separator, value = line.decode("utf-8", "surrogateescape").partition(":" if is_nrrd else "=")
        if is_nrrd and not line.strip():  # an empty line ends the header
            break
        if separator:  # NRRD's pairs of key and value, :=, keep a sign: they are no fields of its own
            sign = "=" if value.startswith("=") else ""
            fields[name.replace(" ", "").strip().lower() + sign] = value.removeprefix(sign).strip()
        if "elementdatafile" in fields:  # the last one
            break
    if head.tell() == MAX_HEADER_BYTES:
        raise ArgumentError(f"expected a header of less than {MAX_HEADER_BYTES} bytes, got a longer one")
    if not is_nrrd and "elementdatafile" not in fields:
        raise ArgumentError("expected a MetaImage file, found no ElementDataFile in its header")
    return fields, head.tell()


def unit_in(fields: Mapping[str, str]) -> str:
    """Return the unit of an NRRD's space, or "" if there are none or several."""
    units = set(UNIT.findall(fields.get("spaceunits", "")))
    return units.pop() if len(units) == 1 else ""


def spacing_in(fields: Mapping[str, str]) -> Triple | None:
    """Return the spacing of a volume that is prepared, with axes of its file; None of others."""
    said = fields.get(f"{UPRIGHT_SPACING}=", "").split()
    return (float(said[0]), float(said[1]), float(said[2])) if said else None


def samples_of(header: Path) -> Path | None:
    """Return the separate file with the samples of a header; None if there is none."""
    if (suffix := header.suffix.lower()) in ANALYZE:
        path = header.with_suffix(next(each for each in ANALYZE if each != suffix))
        return path if path.is_file() else None
    if suffix not in (*NRRD, *METAIMAGE):
        return None
    try:
        path = samples_file(header, read_fields(header)[0])
        return path if path != header and path.is_file() else None
    except (OSError, ArgumentError):  # whoever reads the file will say so
        return None


def samples_file(header: Path, fields: dict[str, str]) -> Path:
    """Return the file with the samples, which may be that of the header."""
    key = "datafile" if header.suffix.lower() in NRRD else "elementdatafile"
    name = fields.get(key, "LOCAL")
    if name.upper() == "LOCAL":
        return header
    if name.startswith("LIST") or "%" in name:
        raise ArgumentError(f"expected one file of samples, got one per slice ({key}: {name}); join them")
    path = named_file(key, header.parent, name)
    if path.exists():
        return path
    # Windows has another separator of folders, and no case of letters.
    path = named_file(key, header.parent, name.replace("\\", "/"))
    beside = path.parent.iterdir() if path.parent.is_dir() else ()
    return next((each for each in beside if each.name.lower() == path.name.lower()), path)


def require_itself(path: Path) -> bytes:
    """Refuse a pointer or a page in place of a file; return the first bytes of the file."""
    with path.open("rb") as file:
        start = file.read(64)
    if start.startswith(LFS):
        raise ArgumentError("expected a file, got a pointer of Git LFS in its place; run git lfs pull")
    if start.lstrip().lower().startswith(PAGES):
        raise ArgumentError("expected a file, got a page of HTML in its place; download it again, logged in")
    return start
