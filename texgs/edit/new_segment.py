"""A new segment of a scene from clicks on a view of a model, and a preview of its mask."""

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.lens import Lens
from texgs.core.light import HEADLIGHT, Light
from texgs.core.names import require_name
from texgs.core.progress import let_stop
from texgs.edit.clicks import Clicks, places_of
from texgs.edit.lift import Lifted, lift, view_mask
from texgs.edit.mask_keys import MaskKeys
from texgs.fields.surfels.model import Surfels
from texgs.models.masks import MaskModel
from texgs.models.sam import mask_model
from texgs.scene.parts import require_new, split
from texgs.scene.scene import Scene
from texgs.scene.session import Session
from texgs.volume.cameras import icosphere_of

MASK_COLOR, MASK_OPACITY = (1.0, 0.1, 0.1), 0.6  # colour over the mask, and its opacity
POSITIVE_COLOR, NEGATIVE_COLOR = (0.0, 0.7, 0.0), (0.0, 0.0, 0.9)  # colours of clicks
CLICK_RADIUS = 0.008  # radius, in longer sides of the picture


class Segmented(NamedTuple):
    """The model of a new segment, and the evidence for it."""

    model: Surfels
    lifted: Lifted


def new_segment(
    session: Session,
    part: str,
    clicks: Clicks,
    keys: MaskKeys,
    lens: Lens,
    file: Callable[[], Path],
    facts: Mapping[str, Any],
    *,
    cameras: Sequence[Camera] = (),
    masks: MaskModel | None = None,
    threshold: float | None = None,
    title: str = "segment",
) -> Segmented:
    """Find a segment of a model by clicks, write its file, and add it to the scene in one step.

    Args:
        session: whose scene has the model; it may be edited meanwhile.
        part: MODEL/SEGMENT, a new name.
        clicks: on a view of `clicked_model`, on the device to compute on.
        keys: how masks are found and become surfels.
        lens: of the views that vote, but for their size.
        file: returns the target, once the segment is found.
        facts: the clicks as JSON; the file records them with the keys.
        cameras: of the views that vote; by default from the keys.
        masks: mask model; by default from the keys.
        threshold: of the votes, see `lift`.
        title: of the progress bar.
    """
    scene, device = session.scene, clicks.points.device
    require_new(scene, part)
    name, segment = split(scene, part)
    require_name(segment, "segment")
    model = clicked_model(scene, name, device)
    around = cameras or icosphere_of(keys.views, lens.square(keys.size))
    lifted = lift(
        model,
        clicks,
        [camera.to(device) for camera in around],
        masks or mask_model(keys.masks, device),
        light=scene.light,
        vote=keys.vote,  # type: ignore[arg-type]
        threshold=threshold,
        connected=keys.connected,
        title=title,
    )
    let_stop(title)
    sys.stderr.write(f"{part}: {lifted.basis}\n")
    with session.one_step(f"{part} new"):
        session.make_segment(part, lifted.mask, file(), {**asdict(keys), **facts})
    return Segmented(model, lifted)


def clicked_model(scene: Scene, name: str, device: torch.device) -> Surfels:
    """Return a model of a scene alone, with its textures there but without other edits.

    Clicks refer to this model: parts that an edit fades or hides are opaque here.
    """
    return scene.models[name].surfels()[0].to(device)


def model_name(scene: Scene, name: str | None, where: str) -> str:
    """Return the name of the model to segment: the given one (see `where`), or the only one."""
    if not name and len(scene.models) == 1:
        return next(iter(scene.models))
    if name not in scene.models:
        raise ArgumentError(f"{where}: expected one of {', '.join(scene.models)}, got {name or 'none'}")
    return str(name)


def clicked_mask(model: Surfels, clicks: Clicks, masks: MaskModel, light: Light = HEADLIGHT) -> Tensor:
    """Return the mask [H, W] bool of a view from clicks on it.

    Mask models that remember images answer further clicks on a view at once.
    """
    places_of(model, clicks)  # they have to be on the model
    return view_mask(model, clicks, masks, light)


@torch.no_grad()
def preview(model: Surfels, clicks: Clicks, masks: MaskModel, light: Light = HEADLIGHT) -> Tensor:
    """Return a picture [H, W, 3] of the clicked view with its mask and the clicks."""
    mask = clicked_mask(model, clicks, masks, light)
    return overlay(model.render(clicks.camera, light).color.clamp(0, 1), mask, clicks)


def overlay(image: Tensor, mask: Tensor, clicks: Clicks) -> Tensor:
    """Return an image [H, W, 3] with a mask [H, W] in red, positive clicks in green and negative in blue."""
    shown = torch.where(
        mask[..., None], (1 - MASK_OPACITY) * image + MASK_OPACITY * image.new_tensor(MASK_COLOR), image
    )
    height, width = mask.shape
    rows, columns = (torch.arange(size, device=image.device) + 0.5 for size in (height, width))
    for (x, y), is_positive in zip(clicks.points.tolist(), clicks.positive.tolist(), strict=True):
        near = (rows[:, None] - y).square() + (columns[None] - x).square() <= (
            CLICK_RADIUS * max(mask.shape)
        ) ** 2
        shown = torch.where(
            near[..., None], image.new_tensor(POSITIVE_COLOR if is_positive else NEGATIVE_COLOR), shown
        )
    return shown
