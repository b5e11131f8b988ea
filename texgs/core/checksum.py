"""SHA-256 of files, remembered for as long as a file keeps its size and time."""

import hashlib
import json
from collections.abc import Iterable
from pathlib import Path

from texgs.core.cache import cache_folder, keep, recall
from texgs.core.errors import ArgumentError

CACHE = "checksums.json"  # in the cache folder
MOST = 20_000  # files in it, the latest ones


def sha256(path: str | Path) -> str:
    """Return the checksum of a file's contents as they are now."""
    try:
        with Path(path).open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise ArgumentError(f"{path}: cannot be read ({error.strerror})") from error


def digest(text: str) -> str:
    """Return the first 12 hexadecimal digits of the SHA-256 of a text."""
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def combined(parts: Iterable[tuple[str, str]]) -> str:
    """Return one checksum of several names with their checksums, in any order."""
    return hashlib.sha256(json.dumps(sorted(parts)).encode()).hexdigest()


def of_folders(*folders: Path) -> str:
    """Return one checksum of the names and contents of all files below folders, without compiled Python."""
    return combined(
        (f"{index} {path.relative_to(folder).as_posix()}", sha256(path))
        for index, folder in enumerate(folders)
        for path in folder.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    )


class Checksums:
    """Checksums of files that are not read again while their size and time stay the same.

    A file that was changed behind the back of both is noticed only by `sha256`.
    """

    def __init__(self) -> None:
        self._known: dict[str, list[int | str]] = {}
        self._is_new = False

    @classmethod
    def load(cls) -> "Checksums":
        """Return what earlier processes have computed, from the cache folder."""
        checksums = cls()
        known = recall(cache_folder() / CACHE, CACHE)
        checksums._known = known if isinstance(known, dict) else {}
        return checksums

    def save(self) -> None:
        """Keep them for later processes; where the cache cannot be written, they will compute them again."""
        if self._is_new:
            self._known = dict(list(self._known.items())[-MOST:])
            keep(cache_folder() / CACHE, CACHE, self._known)
            self._is_new = False

    def of(self, path: Path) -> str:
        """Return the checksum of a file."""
        try:
            status = path.stat()
        except OSError as error:
            raise ArgumentError(f"{path}: cannot be read ({error.strerror})") from error
        key, state = str(path.absolute()), [status.st_size, status.st_mtime_ns]
        known = self._known.get(key)
        if isinstance(known, list) and known[:2] == state and len(known) == 3:
            return str(known[2])
        digest = sha256(path)
        self._known[key] = [*state, digest]
        self._is_new = True
        return digest

    def forget(self, path: Path) -> None:
        """Compute the checksum of a file anew the next time."""
        if self._known.pop(str(path.absolute()), None) is not None:
            self._is_new = True
