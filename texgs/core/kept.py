"""Keep in a file what was worked out, together with a key of all that it depends on."""

import hashlib
import json
from contextlib import suppress
from pathlib import Path
from typing import Any

from texgs.core.errors import ArgumentError
from texgs.core.io import write_atomic


def fingerprint(*folders: Path) -> str:
    """Digest of the names and contents of all files below folders, without what Python compiled."""
    total = hashlib.sha256()
    for folder in folders:
        for path in sorted(folder.rglob("*")):
            if "__pycache__" not in path.parts and path.is_file():
                total.update(f"{path.relative_to(folder).as_posix()}\0".encode())
                total.update(hashlib.sha256(path.read_bytes()).digest())
    return total.hexdigest()


def recall(path: Path, key: str) -> Any | None:
    """What `keep` wrote to a file for the same key; None if it did not."""
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        return kept["value"] if kept["key"] == key else None
    except (OSError, ValueError, KeyError, TypeError):  # not there, damaged, or of something else
        return None


def keep(path: Path, key: str, value: Any) -> None:
    """Write a value that JSON can hold. Where the folder cannot be written to, nothing is kept.

    Args:
        path: file.
        key: everything that the value depends on.
        value: what `recall` returns.
    """
    text = json.dumps({"key": key, "value": value})
    with suppress(ArgumentError):
        write_atomic(path, lambda file: file.write(text.encode()))
