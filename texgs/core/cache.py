"""Folders outside the project that a user can choose, and files of what was worked out once."""

import json
import os
from contextlib import suppress
from pathlib import Path
from typing import Any

from texgs.core.errors import ArgumentError
from texgs.core.io import write_bytes


def cache_folder() -> Path:
    """Return the folder for what is worth keeping: TEXGS_CACHE, else texgs in the user's cache."""
    try:
        if chosen := os.environ.get("TEXGS_CACHE"):
            return Path(chosen).expanduser()
        return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "texgs"
    except RuntimeError:
        raise ArgumentError(
            "HOME: expected the home folder of this user, got none; set TEXGS_CACHE to a folder for downloads"
        ) from None


def weights_folder() -> Path:
    """Return the folder of pretrained weights: TEXGS_WEIGHTS, else weights in the cache folder."""
    chosen = os.environ.get("TEXGS_WEIGHTS")
    return Path(chosen).expanduser() if chosen else cache_folder() / "weights"


def recall(path: Path, key: str) -> Any | None:
    """Return what `keep` wrote to a file for the same key; None if it did not."""
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        return kept["value"] if kept["key"] == key else None
    except (OSError, ValueError, KeyError, TypeError):  # not there, damaged, or of something else
        return None


def keep(path: Path, key: str, value: Any) -> None:
    """Write a value that JSON can hold and the key of all it depends on, where that can be written."""
    with suppress(ArgumentError, OSError):
        write_bytes(path, json.dumps({"key": key, "value": value}).encode())
