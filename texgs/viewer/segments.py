"""Masks and segments from clicks."""

import base64
import io
from contextlib import suppress
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import torch
from PIL import Image
from torch import Tensor

from texgs.core.cuts import NO_CUTS
from texgs.core.errors import TexgsError
from texgs.edit.clicks import Clicks, inside_of, places_of
from texgs.edit.lift import Lifted, lift, view_mask
from texgs.edit.new_segment import clicked_model
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.model import Surfels
from texgs.models.masks import MaskModel
from texgs.models.sam import mask_model
from texgs.scene.parts import entry_of, split
from texgs.scene.scene import Scene
from texgs.scene.session import state_of
from texgs.viewer.messages import Clicked, Mask, Segment
from texgs.volume.cameras import icosphere_of

VIEWS, SIZE = 42, 512  # that vote, as `texgs segment` has them, and pixels of their sides
COLOR = (170, 0, 255, 150)  # over what is masked
CHOICES = ("mobile_sam", "grabcut")  # the first whose weights are here


class Segmenter:
    """Finds what clicks select, in one view and in space."""

    def __init__(self, device: torch.device | str = "cpu") -> None:
        self._device = torch.device(device)
        self._masks: MaskModel | None = None
        self._opened: tuple[list[object], Surfels] | None = None  # states of its files

    def mask(self, scene: Scene, asked: Mask) -> dict[str, Any]:
        """Return the mask of a view as a message with a PNG picture, which is transparent elsewhere."""
        model, clicks = self._model(scene, asked.model), self._clicks(asked)
        places_of(model, clicks)  # they have to be on the model
        mask = view_mask(model, clicks, self._mask_model(), scene.light)
        return {"type": "mask", "id": asked.id, "picture": picture_of(mask), "by": self._mask_model().name}

    def lift(self, scene: Scene, asked: Segment) -> Lifted:
        """Return the surfels that masks of many views agree on, which have the scene's light."""
        model = self._model(scene, split(scene, asked.part)[0])
        lens = scene.framed().lens().square(SIZE)
        cameras = [camera.to(self._device) for camera in icosphere_of(VIEWS, lens)]
        clicks, masks, title = self._clicks(asked), self._mask_model(), f"segment {asked.part}"
        return lift(model, clicks, cameras, masks, light=scene.light, title=title)

    def facts(self, asked: Segment) -> dict[str, Any]:
        """Return what a segment comes from, for its file."""
        name = "" if self._masks is None else self._masks.name
        on, off = ([[x, y] for x, y, is_on in asked.points if is_on == sign] for sign in (True, False))
        shown = {"camera": asdict(asked.camera), "point": on, "other": off, "outline": asked.outline}
        return {**shown, "masks": name, "vote": "contribution"}

    def _clicks(self, clicked: Clicked) -> Clicks:
        """Return the clicks of a page."""
        points = torch.tensor([point[:2] for point in clicked.points], device=self._device).reshape(-1, 2)
        positive = torch.tensor([point[2] for point in clicked.points], dtype=torch.bool, device=self._device)
        camera, outline = clicked.camera.camera().to(self._device), clicked.outline
        held = inside_of(torch.tensor(outline, device=self._device), camera) if outline else None
        return Clicks(camera, points, positive, held)

    def _model(self, scene: Scene, name: str) -> Surfels:
        """Return a model with its textures, kept for the next click."""
        entry_of(scene, name)
        model = scene.models[split(scene, name)[0]]
        states: list[object] = [state_of(file) for file in model.files]
        if self._opened is None or self._opened[0] != states:
            self._opened = (states, clicked_model(scene, name, self._device))
        return self._opened[1]

    def _mask_model(self) -> MaskModel:
        """Return MobileSAM where its weights are, else GrabCut, which has none."""
        for choice in CHOICES:
            if self._masks is None:
                with suppress(TexgsError):
                    self._masks = mask_model(choice, self._device)
        assert self._masks is not None, "GrabCut is always there"
        return self._masks


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
    pixels[mask.cpu().numpy()] = COLOR
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, format="PNG")
    return f"data:image/png;base64,{base64.b64encode(file.getvalue()).decode()}"
