"""What a mask looks like on the view that was clicked on, before anything is lifted."""

from __future__ import annotations

import torch
from torch import Tensor

from texgs.core.light import Light
from texgs.edit.clicks import Clicks, prompts_at
from texgs.edit.lift import HEADLIGHT, ViewMasks
from texgs.fields.surfels.model import Surfels
from texgs.models.masks import MaskModel

MASKED, COVER = (1.0, 0.1, 0.1), 0.6  # colour over what is masked, and its opacity
POSITIVE, NEGATIVE = (0.0, 0.7, 0.0), (0.0, 0.0, 0.9)  # of clicks
RADIUS = 0.008  # of clicks, of the longer side


@torch.no_grad()
def preview(
    model: Surfels, clicks: Clicks, masks: MaskModel, light: Light = HEADLIGHT
) -> tuple[Tensor, Tensor]:
    """The mask [H, W] bool of a view from clicks on it, and a picture [H, W, 3] of both.

    A mask model that remembers images answers the second click on a view at once.

    Args:
        model: of any stage.
        clicks: on the view.
        masks: finds the object.
        light: in the view.

    Raises:
        ArgumentError: if a click is outside of the view or on the background.
    """
    prompts_at(model, clicks)
    mask = ViewMasks(model, light, masks).mask(clicks)
    image = model.render(clicks.camera, light).color.clamp(0, 1)
    return mask, overlay(image, mask, clicks.points, clicks.positive)


def overlay(image: Tensor, mask: Tensor, points: Tensor, positive: Tensor) -> Tensor:
    """An image [H, W, 3] with a mask [H, W] in red, positive clicks [P, 2] in green and negative in blue."""
    shown = torch.where(mask[..., None], (1 - COVER) * image + COVER * image.new_tensor(MASKED), image)
    height, width = mask.shape
    rows, columns = (torch.arange(size, device=image.device) + 0.5 for size in (height, width))
    for (x, y), is_positive in zip(points.tolist(), positive.tolist(), strict=True):
        near = (rows[:, None] - y).square() + (columns[None] - x).square() <= (RADIUS * max(mask.shape)) ** 2
        shown = torch.where(near[..., None], image.new_tensor(POSITIVE if is_positive else NEGATIVE), shown)
    return shown
