"""Pictures that styles are taken from: those that texgs paints, and files that pages send."""

from __future__ import annotations

import io
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Lock

import numpy as np
from PIL import Image

from texgs.core.errors import ArgumentError
from texgs.core.names import file_name
from texgs.edit.pictures import PICTURES, picture
from texgs.edit.style_picture import read_style

LARGEST = 32 * 2**20  # bytes of a file
MOST = 50  # files
THUMBNAIL = 96  # pixels of a side


class Styles:
    """Pictures by name. Files are kept as long as this is."""

    def __init__(self) -> None:
        self._folder = TemporaryDirectory(prefix="texgs-styles-")
        self._files: dict[str, Path] = {}
        self._adding = Lock()  # pages may send several at once

    def add(self, name: str, content: bytes) -> str:
        """Take a file in; the name that it has from then on.

        Args:
            name: that its author gave it, with an ending.
            content: of the file.
        """
        with self._adding:
            return self._add(name, content)

    def _add(self, name: str, content: bytes) -> str:
        if len(self._files) >= MOST:
            raise ArgumentError(f"style: expected at most {MOST} pictures, got another one; start again")
        known = f"{len(self._files) + 1} {file_name('style', name)}"
        path = Path(self._folder.name, known)
        path.write_bytes(content)
        try:
            read_style(path)
        except ArgumentError as error:
            path.unlink()
            raise ArgumentError(str(error).replace(str(path), name)) from error
        self._files[known] = path
        return known

    def source(self, name: str) -> str:
        """Return what `edit.image.style` is for a picture."""
        if name not in PICTURES and name not in self._files:
            raise ArgumentError(f"style: expected one of {', '.join(PICTURES)}, or a file; got {name!r:.100}")
        return str(self._files.get(name, name))

    def close(self) -> None:
        """Remove the files."""
        self._folder.cleanup()


@lru_cache
def thumbnail(name: str) -> bytes:
    """Return a small view of a picture that texgs paints, as JPEG."""
    pixels = picture(name, 4 * THUMBNAIL).permute(1, 2, 0).numpy()
    file = io.BytesIO()
    shown = Image.fromarray((255 * pixels).round().astype(np.uint8)).resize((THUMBNAIL, THUMBNAIL))
    shown.save(file, "JPEG", quality=85)
    return file.getvalue()
