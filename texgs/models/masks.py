"""Models that find an object in an image from clicks: interface, cache of features, and GrabCut."""

from collections import OrderedDict
from collections.abc import Callable
from hashlib import blake2b
from typing import Protocol

import cv2
import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from texgs.core import check
from texgs.core.errors import ArgumentError

REMEMBERED_IMAGES = 64  # features to keep, of the training views and the clicked view
SIZE = 320  # pixels of the longer side to segment; larger images are reduced, masks enlarged
SEED_RADIUS = 0.01  # radius that a click marks for certain, in longer sides
ALIKE_CHANNELS = 16  # of 255: largest difference per channel within a click's object
PLAIN_CHANNELS = 20  # of 255, within an empty background; smaller values split it
ROUNDS = 5
FEW_SHARE = 0.1  # smallest mask relative to the outline; smaller ones are unreliable
Pixels = Tensor | None  # [H, W] bool


class MaskModel(Protocol):
    """Finds the object under the positive points and not under the negative ones."""

    name: str  # for tables and files

    def __call__(
        self, image: Tensor, points: Tensor, positive: Tensor, held: Pixels = None, shown: Pixels = None
    ) -> Tensor:
        """Return the object in an image [H, W, 3] as shown on a screen, [H, W] bool, on its device.

        Points [P, 2] are right and down in pixels; the centre of the first pixel is (0.5, 0.5). At least one
        is positive [P] bool, unless an outline says which pixels the object is among. What is not shown, by
        default nothing, is background; callers cut it off masks.
        """


def check_clicks(image: Tensor, points: Tensor, positive: Tensor, held: Tensor | None) -> None:
    """Check the arguments of a mask model."""
    size = check.shape("image", image, "H W 3")
    count = check.shape("points", points, "P 2")["P"]
    check.shape("positive", positive, "P", P=count)
    check.finite(image=image, points=points)
    if positive.dtype != torch.bool or not bool((positive if held is None else held).any()):
        what = "points: expected a positive one at least" if held is None else "outline: expected an object"
        raise ArgumentError(f"{what}, got none; click on the object, or draw around it")
    for x, y in points.tolist():
        if not (0 <= x < size["W"] and 0 <= y < size["H"]):
            raise ArgumentError(
                f"points: expected places in the image of {size['W']} x {size['H']} pixels, "
                f"got ({x:g}, {y:g})"
            )


class Remembered:
    """A cache for a slow function of images."""

    def __init__(self, function: Callable[[Tensor], Tensor], most: int = REMEMBERED_IMAGES) -> None:
        self.function, self.most = function, most
        self.results: OrderedDict[bytes, Tensor] = OrderedDict()

    def __call__(self, image: Tensor) -> Tensor:
        """Return the result for an image; compute it for new pixels."""
        pixels = image.detach().cpu().contiguous().numpy()
        key = blake2b(f"{pixels.dtype} {pixels.shape}".encode() + pixels.tobytes(), digest_size=16).digest()
        if key not in self.results:
            self.results[key] = self.function(image)
            while len(self.results) > self.most:
                self.results.popitem(last=False)
        self.results.move_to_end(key)
        return self.results[key]


class GrabCut:
    """A mask model without learned weights: the offline counterpart of SAM (Rother et al. 2004).

    It separates objects by colour and contrast, whatever is said to be shown. A plain border of the image is
    background, and so is what this separates from all positive clicks. Of the rest, what is connected to a
    click and of its colour is taken for the object at first, or not, as the click says; Gaussian mixtures of
    the colours of both and a minimal cut then move the outline. What a user drew around is taken at first,
    all of it.
    """

    name = "GrabCut"

    def __call__(
        self, image: Tensor, points: Tensor, positive: Tensor, held: Pixels = None, shown: Pixels = None
    ) -> Tensor:
        """Return the object [H, W] bool in an image, on the image's device; see `MaskModel`."""
        check_clicks(image, points, positive, held)
        shape = (image.shape[0], image.shape[1])
        scale = min(SIZE / max(shape), 1.0)
        height, width = (max(round(side * scale), 1) for side in shape)
        planes = image.detach().cpu().float().permute(2, 0, 1)[None]
        planes = F.interpolate(planes, (height, width), mode="bilinear", antialias=True)
        pixels = planes[0].clamp(0, 1).mul(255).round().to(torch.uint8).permute(1, 2, 0).contiguous().numpy()
        shrink = points.new_tensor([width / shape[1], height / shape[0]])
        places = np.floor((points * shrink).cpu().numpy()).astype(int).clip(0, (width - 1, height - 1))
        if held is not None:
            held = F.interpolate(held[None, None].cpu().float(), (height, width), mode="area")[0, 0] > 0
        foreground = cut(pixels, places, positive.cpu().numpy(), None if held is None else held.numpy())
        mask = torch.from_numpy(foreground).float()[None, None]
        return (F.interpolate(mask, shape, mode="bilinear")[0, 0] > 0.5).to(image.device)


def cut(pixels: np.ndarray, places: np.ndarray, positive: np.ndarray, held: np.ndarray | None) -> np.ndarray:
    """Return the object [H, W] bool in an 8-bit image with clicks at pixels [P, 2], or all in an outline."""
    plain, on_it = plain_border(pixels), places[positive]
    if held is not None:
        held &= ~plain
        rest = held & (connected_mask(held, places[positive]) | ~connected_mask(held, places[~positive]))
        held = rest if rest.any() else held  # without parts under negative clicks only
        on_it = np.argwhere(held)[:, ::-1]
    clicked = connected_mask(~plain, on_it)
    # Other objects would teach the mixture of the background their colours, which may be those of this one.
    emptied = np.where(clicked[..., None], pixels, np.median(pixels[plain], axis=0) if plain.any() else 0)
    emptied = emptied.astype(np.uint8)
    labels = first_guess(emptied, clicked if held is None else held, places, positive, held is not None)
    is_object = np.isin(labels, (cv2.GC_FGD, cv2.GC_PR_FGD))
    if is_object.any() and not is_object.all():
        cv2.setRNGSeed(0)
        models = np.zeros((2, 1, 65))
        cv2.grabCut(emptied, labels, (0, 0, 0, 0), models[0], models[1], ROUNDS, cv2.GC_INIT_WITH_MASK)
        is_object = np.isin(labels, (cv2.GC_FGD, cv2.GC_PR_FGD))
    found = connected_mask(is_object, on_it)
    return found if held is None or found.sum() > FEW_SHARE * held.sum() else held


def first_guess(
    pixels: np.ndarray, clicked: np.ndarray, places: np.ndarray, positive: np.ndarray, is_drawn: bool
) -> np.ndarray:
    """Return the start labels [H, W] of GrabCut: certain at clicks and outside, otherwise probable."""
    smooth = cv2.GaussianBlur(pixels, (3, 3), 0)
    probable = cv2.GC_PR_BGD if positive.any() else cv2.GC_PR_FGD
    labels = np.where(clicked, probable, cv2.GC_BGD).astype(np.uint8)
    is_inside = is_drawn or not (clicked[[0, -1]].any() or clicked[:, [0, -1]].any())  # needs a plain border
    if is_inside and positive.any():  # all of it is the object, but for what looks like negative clicks
        colors = smooth[places[:, 1], places[:, 0]].astype(int)  # [P, 3]
        nearest = np.abs(smooth[..., None, :].astype(int) - colors).sum(axis=-1).argmin(axis=-1)  # [H, W]
        labels[clicked & positive[nearest]] = cv2.GC_PR_FGD
    order = np.argsort(~positive, kind="stable")  # negative clicks last: they take from positive ones
    clicks = list(zip(places[order], positive[order], strict=True))
    for place, is_positive in clicks:
        alike = flood(smooth, place, ALIKE_CHANNELS) & clicked
        labels[alike] = cv2.GC_PR_FGD if is_positive else cv2.GC_PR_BGD
    radius = max(round(SEED_RADIUS * max(labels.shape)), 1)
    for place, is_positive in clicks:
        certain = cv2.GC_FGD if is_positive else cv2.GC_BGD
        cv2.circle(labels, tuple(map(int, place)), radius, int(certain), -1)
    return labels


def plain_border(pixels: np.ndarray) -> np.ndarray:
    """Return pixels [H, W] bool of one colour that are connected to a corner."""
    height, width = pixels.shape[:2]
    corners = ((0, 0), (width - 1, 0), (0, height - 1), (width - 1, height - 1))
    return np.any([flood(pixels, corner, PLAIN_CHANNELS) for corner in corners], axis=0)


def connected_mask(mask: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return the connected parts of a mask under given places."""
    _, parts = cv2.connectedComponents(mask.astype(np.uint8))
    return np.isin(parts, np.setdiff1d(parts[places[:, 1], places[:, 0]], 0))


def flood(pixels: np.ndarray, place: tuple[int, int] | np.ndarray, most: int) -> np.ndarray:
    """Flood-fill pixels [H, W] bool from a place; channels may differ from it by `most`."""
    height, width = pixels.shape[:2]
    filled = np.zeros((height + 2, width + 2), dtype=np.uint8)
    flags = 4 | cv2.FLOODFILL_MASK_ONLY | cv2.FLOODFILL_FIXED_RANGE | (1 << 8)
    x, y = (int(value) for value in place)
    cv2.floodFill(pixels.copy(), filled, (x, y), 0, (most,) * 3, (most,) * 3, flags)
    return filled[1:-1, 1:-1] > 0
