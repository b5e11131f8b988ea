"""Headers of volumes whose samples are in another file."""

from __future__ import annotations

import re
from pathlib import Path

LONGEST = 1 << 16  # bytes of such a header that are looked at
META, NRRD = rb"^\s*ElementDataFile\s*=(.*)$", rb"^data ?file:(.*)$"
KEYS = {".mhd": META, ".mha": META, ".nhdr": NRRD, ".nrrd": NRRD}  # by suffix


def samples_of(header: Path) -> Path | None:
    """The file with the samples of a header; None where it is no such header, or that file is not there."""
    key = KEYS.get(header.suffix.lower())
    if key is None:
        return None
    try:
        with header.open("rb") as file:
            line = re.search(key, file.read(LONGEST), re.MULTILINE)
    except OSError:  # not there yet, or not for us: whoever reads it tells
        return None
    if line is None:
        return None
    path = header.parent / line[1].decode("utf-8", "surrogateescape").strip()
    return path if path.is_file() else None
