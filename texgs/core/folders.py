"""Folders outside the project that a user can choose by environment variables."""

import os
from pathlib import Path

from texgs.core.errors import ArgumentError


def cache_folder() -> Path:
    """Return the folder for downloads and results worth keeping: TEXGS_CACHE, else texgs in the user's cache.

    Raises:
        ArgumentError: if there is neither, because this user has no home folder.
    """
    try:
        if chosen := os.environ.get("TEXGS_CACHE"):
            return Path(chosen).expanduser()
        return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "texgs"
    except RuntimeError:
        raise ArgumentError(
            "HOME: expected the home folder of this user, got none; set TEXGS_CACHE to a folder for downloads"
        ) from None


def weights_folder() -> Path:
    """Return folder with weights of pretrained models: TEXGS_WEIGHTS, else weights in the cache folder."""
    chosen = os.environ.get("TEXGS_WEIGHTS")
    return Path(chosen).expanduser() if chosen else cache_folder() / "weights"
