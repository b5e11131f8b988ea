"""Files kept outside the project: cache folders, cached values, and checksums."""

import hashlib
import json
import os
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

from texgs.core.errors import ArgumentError
from texgs.core.io import write_bytes

CHECKSUMS_FILE = "checksums.json"  # in the cache folder
MAX_CHECKSUMS = 20_000  # most recent files


def cache_folder() -> Path:
    """Return the cache folder: TEXGS_CACHE, or texgs in the user's cache."""
    try:
        if chosen := os.environ.get("TEXGS_CACHE"):
            return Path(chosen).expanduser()
        return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "texgs"
    except RuntimeError:
        raise ArgumentError(
            "HOME: expected the home folder of this user, got none; set TEXGS_CACHE to a folder for downloads"
        ) from None


def weights_folder() -> Path:
    """Return the folder of pretrained weights: TEXGS_WEIGHTS, or weights in the cache folder."""
    chosen = os.environ.get("TEXGS_WEIGHTS")
    return Path(chosen).expanduser() if chosen else cache_folder() / "weights"


def recall(path: Path, key: str) -> Any | None:
    """Return the value that `keep` wrote to a file for the same key, or None."""
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        return kept["value"] if kept["key"] == key else None
    except (OSError, ValueError, KeyError, TypeError):  # missing, damaged, or a different kind of file
        return None


def keep(path: Path, key: str, value: Any) -> None:
    """Write a JSON value with the key that it depends on, if the folder can be written."""
    with suppress(ArgumentError, OSError):
        write_bytes(path, json.dumps({"key": key, "value": value}).encode())


def sha256(path: str | Path) -> str:
    """Return the SHA-256 of a file's current contents."""
    try:
        with Path(path).open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise ArgumentError(f"{path}: cannot be read ({error.strerror})") from error


def digest(text: str) -> str:
    """Return the first 12 hexadecimal digits of the SHA-256 of a text."""
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def combined_checksum(parts: Iterable[tuple[str, str]]) -> str:
    """Combine named checksums into one, whatever their order."""
    return hashlib.sha256(json.dumps(sorted(parts)).encode()).hexdigest()


def checksum_of_folders(*folders: Path) -> str:
    """Return a checksum of the names and contents of all files below folders, except compiled Python."""
    return combined_checksum(
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
        """Read the checksums of earlier processes from the cache folder."""
        checksums = cls()
        known = recall(cache_folder() / CHECKSUMS_FILE, CHECKSUMS_FILE)
        checksums._known = known if isinstance(known, dict) else {}
        return checksums

    def save(self) -> None:
        """Save them for later processes; without a writable cache these compute them again."""
        if self._is_new:
            self._known = dict(list(self._known.items())[-MAX_CHECKSUMS:])
            keep(cache_folder() / CHECKSUMS_FILE, CHECKSUMS_FILE, self._known)
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
        """Forget the checksum of a file, so that the next call computes it again."""
        if self._known.pop(str(path.absolute()), None) is not None:
            self._is_new = True
