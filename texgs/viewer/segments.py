"""Masks and segments from clicks."""

import base64
import io
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import torch
from PIL import Image
from torch import Tensor

from texgs.core.cuts import NO_CUTS
from texgs.core.errors import TexgsError
from texgs.edit.clicks import Clicks, inside_of
from texgs.edit.lift import Lifted
from texgs.edit.mask_keys import MaskKeys
from texgs.edit.new_segment import clicked_mask, clicked_model, new_segment
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.model import Surfels
from texgs.models.masks import MaskModel
from texgs.models.sam import mask_model
from texgs.scene.parts import entry_of, split
from texgs.scene.scene import Scene
from texgs.scene.session import Session, last_of, state_of
from texgs.viewer.messages import Clicked, Mask, Segment

VOTING = MaskKeys()  # views that vote, and how, as for `texgs segment`
MASK_COLOR = (170, 0, 255, 150)  # over what is masked
CHOICES = ("mobile_sam", "grabcut")  # the first whose weights are here


class Segmenter:
    """Finds what clicks select, in one view and in space."""

    def __init__(self, device: torch.device | str = "cpu") -> None:
        self._device = torch.device(device)
        self._opened = deque[tuple[object, Surfels]](maxlen=1)  # for the next click on the same model

    def mask(self, scene: Scene, asked: Mask) -> dict[str, Any]:
        """Return the mask of a view as a message with a PNG picture, which is transparent elsewhere."""
        entry_of(scene, asked.model)
        name, masks = split(scene, asked.model)[0], self._masks
        states = [state_of(file) for file in scene.models[name].files]
        model = last_of(self._opened, states, lambda: clicked_model(scene, name, self._device))
        mask = clicked_mask(model, self._clicks(asked), masks, scene.light)
        return {"type": "mask", "id": asked.id, "picture": picture_of(mask), "by": masks.name}

    def segment(self, session: Session, asked: Segment, file: Callable[[], Path]) -> Lifted:
        """Make a segment of what clicks select, whose file gets the place that is free in the end."""
        on, off = ([[x, y] for x, y, is_on in asked.points if is_on == sign] for sign in (True, False))
        facts = {"camera": asdict(asked.camera), "point": on, "other": off, "outline": asked.outline}
        made = new_segment(
            *(session, asked.part, self._clicks(asked), VOTING, session.scene.framed().lens(), file),
            {**facts, "masks": self._masks.name},
            masks=self._masks,
            title=f"segment {asked.part}",
        )
        return made.lifted

    def _clicks(self, clicked: Clicked) -> Clicks:
        """Return the clicks of a page."""
        points = torch.tensor([point[:2] for point in clicked.points], device=self._device).reshape(-1, 2)
        positive = torch.tensor([point[2] for point in clicked.points], dtype=torch.bool, device=self._device)
        camera, outline = clicked.camera.camera().to(self._device), clicked.outline
        held = inside_of(torch.tensor(outline, device=self._device), camera) if outline else None
        return Clicks(camera, points, positive, held)

    @cached_property
    def _masks(self) -> MaskModel:
        """Return MobileSAM where its weights are, else GrabCut, which has none."""
        for name in CHOICES[:-1]:
            with suppress(TexgsError):
                return mask_model(name, self._device)
        return mask_model(CHOICES[-1], self._device)


def isolated(scene: Scene, name: str) -> Scene:
    """Return the scene with one of its models, as it is clicked on: with its textures and no other edit."""
    entry_of(scene, name)
    models = {}
    for each, entry in scene.models.items():
        edit = PartEdit(visible=each == name)
        segments = {key: replace(segment, edit=edit) for key, segment in entry.segments.items()}
        models[each] = replace(entry, edit=edit, segments=segments)
    return replace(scene, models=models, cuts=NO_CUTS)


def picture_of(mask: Tensor) -> str:
    """Return a mask [H, W] bool as the address of a PNG picture."""
    pixels = np.zeros((*mask.shape, 4), dtype=np.uint8)
    pixels[mask.cpu().numpy()] = MASK_COLOR
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, format="PNG")
    return f"data:image/png;base64,{base64.b64encode(file.getvalue()).decode()}"
