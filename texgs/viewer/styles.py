"""The pictures to choose from, by name."""

from contextlib import suppress
from pathlib import Path
from threading import Lock
from warnings import catch_warnings

from PIL import Image

from texgs.core.errors import ArgumentError
from texgs.core.image import FORMATS
from texgs.core.names import file_name
from texgs.edit.style_picture import read_style
from texgs.models.pictures import PICTURES

LARGEST_PICTURE = 32 * 2**20  # bytes of a picture that a page sends
MOST_PICTURES = 50  # pictures of a folder, and of pages
MOST_PIXELS = 50_000_000  # of one: more takes many seconds to read, at each preview again


class Styles:
    """Pictures by name: those that texgs has, those of a folder, and files that pages send."""

    def __init__(self, scratch: Path, folder: Path | None = None) -> None:
        self._own = {} if folder is None else pictures_in(folder)
        self._scratch = scratch  # for the files of pages
        self._files: dict[str, Path] = {}
        self._adding = Lock()  # pages may send several at once

    def add(self, name: str, content: bytes) -> str:
        """Take in a file, with the name that its author gave it; return the name that it has from then on."""
        with self._adding:
            if len(self._files) >= MOST_PICTURES:
                expected = f"expected at most {MOST_PICTURES} pictures"
                raise ArgumentError(f"style: {expected}, got another one; start again")
            known = f"{len(self._files) + 1} {file_name('style', name)}"
            path = self._scratch / known
            self._scratch.mkdir(exist_ok=True)
            path.write_bytes(content)
            try:
                require_readable(path)
                read_style(path)
            except ArgumentError as error:
                path.unlink()
                raise ArgumentError(str(error).replace(str(path), name)) from error
            self._files[known] = path
            return known

    @property
    def names(self) -> list[str]:
        """Return those that all pages offer."""
        return [*PICTURES, *self._own]

    def source(self, name: str) -> str:
        """Return what `edit.image.style` is for a picture."""
        if name in PICTURES:
            return name
        path = {**self._own, **self._files}.get(name)
        if path is None:
            raise ArgumentError(f"style: expected one of {', '.join(PICTURES)}, or a file; got {name!r:.100}")
        require_readable(path)
        return str(path)


def pictures_in(folder: Path) -> dict[str, Path]:
    """Return the files of a folder that are pictures by their endings, by name."""
    try:
        files = sorted(folder.iterdir())
    except OSError as error:
        raise ArgumentError(f"--styles: expected a folder, got {folder} ({error.strerror})") from error
    endings = {end for end, kind in Image.registered_extensions().items() if kind in FORMATS}
    pictures = {path.name: path for path in files if path.suffix.lower() in endings}
    if not 0 < len(pictures) <= MOST_PICTURES:
        raise ArgumentError(
            f"--styles: expected 1 to {MOST_PICTURES} pictures (.png, .jpg, .webp, ...) in {folder}, got "
            f"{len(pictures)}; name a folder with {'fewer' if pictures else 'some'}"
        )
    return pictures


def require_readable(path: Path) -> None:
    """Require of a picture, if it is one, that it takes a moment to read."""
    quiet, refused = catch_warnings(action="ignore"), (OSError, Image.DecompressionBombError)
    with suppress(*refused), quiet, Image.open(path, formats=FORMATS) as picture:
        width, height = picture.size
        if width * height > MOST_PIXELS:
            raise ArgumentError(
                f"{path}: expected a picture of at most {MOST_PIXELS // 10**6} million pixels, got {width} x "
                f"{height}; scale it down"
            )
