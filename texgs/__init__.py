"""Editable, relightable, stylisable 3D scenes of textured 2D Gaussians from scientific volumes.

In Python: `Volume`, `fit`, `open`, `Scene` and `results`; they are loaded when they are first used.
"""

import os
from importlib import import_module
from typing import TYPE_CHECKING, Any

from texgs.core.memory import waiting

if TYPE_CHECKING:
    from texgs.api.fit import fit
    from texgs.api.functions import Functions
    from texgs.api.results import results
    from texgs.api.scene import Scene
    from texgs.api.scene import open_scene as open
    from texgs.api.volume import Volume
    from texgs.volume.transfer import TransferFunction

__version__ = "1.1.0"
__all__ = ["Functions", "Scene", "TransferFunction", "Volume", "fit", "open", "results"]

HOMES = {
    "Functions": "texgs.api.functions",
    "Scene": "texgs.api.scene",
    "TransferFunction": "texgs.volume.transfer",
    "Volume": "texgs.api.volume",
    "fit": "texgs.api.fit",
    "open": "texgs.api.scene",
    "results": "texgs.api.results",
}


def __getattr__(name: str) -> Any:
    """Return what the interface offers; nothing of it is imported before, and threads that wait sleep."""
    if name not in HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    for key, value in waiting().items():
        os.environ.setdefault(key, value)  # OpenMP reads it as torch is imported
    return getattr(import_module(HOMES[name]), "open_scene" if name == "open" else name)
