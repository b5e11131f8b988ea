"""Folders that a viewer has until it ends."""

import os
import socket
from pathlib import Path
from shutil import rmtree
from tempfile import TemporaryDirectory, gettempdir

import psutil


def scratch_folder() -> TemporaryDirectory[str]:
    """Return a new one; those of viewers that were killed on this machine are removed."""
    prefix = f"texgs-view-{socket.gethostname()}-"
    for folder in Path(gettempdir()).glob(f"{prefix}*"):
        number = folder.name.removeprefix(prefix).partition("-")[0]
        if number.isdecimal() and not psutil.pid_exists(int(number)):
            rmtree(folder, ignore_errors=True)  # it may be another user's
    return TemporaryDirectory(prefix=f"{prefix}{os.getpid()}-")
