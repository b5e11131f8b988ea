"""A new segment of a scene, from clicks on a view of one of its models; and how a mask looks before that."""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.light import HEADLIGHT, Light
from texgs.edit.clicks import Clicks, places_of
from texgs.edit.lift import Lifted, lift, view_mask
from texgs.edit.votes import Vote
from texgs.fields.surfels.model import Surfels
from texgs.models.masks import MaskModel
from texgs.scene.parts import require_new, split
from texgs.scene.scene import Scene
from texgs.scene.session import Session

MASKED, COVER = (1.0, 0.1, 0.1), 0.6  # colour over what is masked, and its opacity
POSITIVE, NEGATIVE = (0.0, 0.7, 0.0), (0.0, 0.0, 0.9)  # of clicks
RADIUS = 0.008  # of clicks, of the longer side


class Segmented(NamedTuple):
    """A scene with a new segment, and what that was found in."""

    scene: Scene
    model: Surfels
    lifted: Lifted


def new_segment(
    scene: Scene,
    part: str,
    clicks: Clicks,
    cameras: Sequence[Camera],
    masks: MaskModel,
    file: Path,
    facts: Mapping[str, Any],
    *,
    vote: Vote = "contribution",
    threshold: float | None = None,
    connected: bool = False,
    title: str = "segment",
) -> Segmented:
    """Find a segment of a model by clicks, write its file, and add it to the scene.

    MODEL/SEGMENT is a new name, and clicks are on a view of the model as `clicked_model` has it; for what
    else finds the segment, see `lift`. The file tells the facts that the segment comes from, JSON.
    """
    require_new(scene, part)
    model = clicked_model(scene, split(scene, part)[0], clicks.points.device)
    lifted = lift(
        *(model, clicks, cameras, masks),
        light=scene.light,
        vote=vote,
        threshold=threshold,
        connected=connected,
        title=title,
    )
    sys.stderr.write(f"{part}: {lifted.basis}\n")
    session = Session(scene)
    session.make_segment(part, lifted.mask, file, facts)
    return Segmented(session.scene, model, lifted)


def clicked_model(scene: Scene, name: str, device: torch.device) -> Surfels:
    """Return a model of a scene with the textures that it has there, alone, without other edits of the scene.

    Clicks are on this: what an edit makes faint or hides is opaque and in front.
    """
    return scene.models[name].surfels()[0].to(device)


def model_name(scene: Scene, name: str | None, where: str) -> str:
    """Return the name of the model to segment: the one given by `where`, or that of the only model."""
    if not name and len(scene.models) == 1:
        return next(iter(scene.models))
    if name not in scene.models:
        raise ArgumentError(f"{where}: expected one of {', '.join(scene.models)}, got {name or 'none'}")
    return str(name)


@torch.no_grad()
def preview(
    model: Surfels, clicks: Clicks, masks: MaskModel, light: Light = HEADLIGHT
) -> tuple[Tensor, Tensor]:
    """Return the mask [H, W] bool of a view from clicks on it, and a picture [H, W, 3] of both.

    A mask model that remembers images answers the second click on a view at once.
    """
    places_of(model, clicks)  # they have to be on the model
    mask = view_mask(model, clicks, masks, light)
    image = model.render(clicks.camera, light).color.clamp(0, 1)
    return mask, overlay(image, mask, clicks)


def overlay(image: Tensor, mask: Tensor, clicks: Clicks) -> Tensor:
    """Return an image [H, W, 3] with a mask [H, W] in red, positive clicks in green and negative in blue."""
    shown = torch.where(mask[..., None], (1 - COVER) * image + COVER * image.new_tensor(MASKED), image)
    height, width = mask.shape
    rows, columns = (torch.arange(size, device=image.device) + 0.5 for size in (height, width))
    for (x, y), is_positive in zip(clicks.points.tolist(), clicks.positive.tolist(), strict=True):
        near = (rows[:, None] - y).square() + (columns[None] - x).square() <= (RADIUS * max(mask.shape)) ** 2
        shown = torch.where(near[..., None], image.new_tensor(POSITIVE if is_positive else NEGATIVE), shown)
    return shown
