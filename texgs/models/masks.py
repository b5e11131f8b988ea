"""Models that find an object in an image from clicks: their names, what they take, give and remember."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from hashlib import blake2b
from pathlib import Path
from typing import Protocol

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.errors import ArgumentError

REMEMBERED = 64  # images whose features are kept: the training views of a lift, and the view clicked on


class MaskModel(Protocol):
    """Finds what the positive points lie on and the negative ones do not."""

    name: str
    """For tables and files."""

    def __call__(self, image: Tensor, points: Tensor, positive: Tensor) -> Tensor:
        """Return the object in an image, [H, W] bool, on the image's device.

        Args:
            image: [H, W, 3] in [0, 1], as shown on a screen.
            points: [P, 2] right and down in pixels; the centre of the first pixel is (0.5, 0.5).
            positive: [P] bool, at least one of them true.
        """


def check_clicks(image: Tensor, points: Tensor, positive: Tensor) -> None:
    """Require what every mask model takes."""
    size = check.shape("image", image, "H W 3")
    count = check.shape("points", points, "P 2")["P"]
    check.shape("positive", positive, "P", P=count)
    check.finite(image=image, points=points)
    if positive.dtype != torch.bool or not bool(positive.any()):
        raise ArgumentError("points: expected a positive one at least, got none; click on the object")
    for x, y in points.tolist():
        if not (0 <= x < size["W"] and 0 <= y < size["H"]):
            raise ArgumentError(
                f"points: expected places in the image of {size['W']} x {size['H']} pixels, "
                f"got ({x:g}, {y:g})"
            )


class Remembered:
    """Results of a slow function of images, kept for the last ones it was asked for."""

    def __init__(self, function: Callable[[Tensor], Tensor], most: int = REMEMBERED) -> None:
        self.function, self.most = function, most
        self.results: OrderedDict[bytes, Tensor] = OrderedDict()

    def __call__(self, image: Tensor) -> Tensor:
        """Return the result for an image, computed where these pixels have not been seen."""
        pixels = image.detach().cpu().contiguous().numpy()
        key = blake2b(f"{pixels.dtype} {pixels.shape}".encode() + pixels.tobytes(), digest_size=16).digest()
        if key not in self.results:
            self.results[key] = self.function(image)
            while len(self.results) > self.most:
                self.results.popitem(last=False)
        self.results.move_to_end(key)
        return self.results[key]


def mask_model(name: str, device: torch.device) -> MaskModel:
    """Return the mask model of a name, or in a folder."""
    from texgs.models.grabcut import GrabCut
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
