"""Folders outside the project that a user can choose by environment variables."""

import os
from pathlib import Path


def cache_folder() -> Path:
    """Return folder for downloads and results worth keeping: TEXGS_CACHE, else texgs in the user's cache."""
    chosen = os.environ.get("TEXGS_CACHE")
    if chosen:
        return Path(chosen).expanduser()
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "texgs"


def weights_folder() -> Path:
    """Return folder with weights of pretrained models: TEXGS_WEIGHTS, else weights in the cache folder."""
    chosen = os.environ.get("TEXGS_WEIGHTS")
    return Path(chosen).expanduser() if chosen else cache_folder() / "weights"
