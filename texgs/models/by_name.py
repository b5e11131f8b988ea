"""Models that find objects by clicks, by the names that users give them."""

from __future__ import annotations

from pathlib import Path

import torch

from texgs.core.errors import ArgumentError
from texgs.models.grabcut import GrabCut
from texgs.models.masks import MaskModel


def mask_model(name: str, device: torch.device) -> MaskModel:
    """The mask model of a name, or in a folder.

    Raises:
        ArgumentError, MissingDataError: if there is neither, or its weights are missing or damaged.
    """
    from texgs.models.sam import PUBLISHED, published_sam, sam_folder

    if name == "grabcut":
        return GrabCut()
    if name in PUBLISHED:
        return published_sam(name, device=device)
    if not Path(name).is_dir():
        raise ArgumentError(
            f"masks: expected {', '.join(PUBLISHED)}, grabcut or a folder with a SAM, got {name}"
        )
    return sam_folder(name, device)
