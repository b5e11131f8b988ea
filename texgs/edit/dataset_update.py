"""Edit views of a field again and again while it learns from them: IN2N, Instruct-GS2GS and DGE alike."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import atan2, isfinite
from typing import Protocol

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.errors import FitError
from texgs.core.progress import progress
from texgs.edit.turns import Schedule, turns
from texgs.fields.field import Field
from texgs.models.guidance import EditViews, Guidance, require_edited
from texgs.models.instruction import require_instruction
from texgs.raster.losses import depth_to_normal
from texgs.volume.images import Images


class Learner(Protocol):
    """A field that learns from views."""

    @property
    def original(self) -> Field:
        """As it was at first."""
        ...

    @property
    def field(self) -> Field:
        """As it is now."""
        ...

    def step(self, images: Images, views: Sequence[int], generator: torch.Generator) -> float:
        """Learn from some of these views, all that memory and method allow; the loss."""
        ...


@dataclass(frozen=True, eq=False)
class Updated:
    """What an edit gives."""

    field: Field
    views: list[tuple[Tensor, Tensor]]
    """Some views that were edited, apart from each other, [H, W, 3]: as they were, and as they are."""
    losses: list[float]
    """In each iteration."""
    edits: int
    """Of single views."""
    guided: float
    """Seconds that edits of views took, of all."""


def update_field(
    learner: Learner,
    images: Images,
    guidance: Guidance,
    instruction: str,
    schedule: Schedule,
    *,
    keeps_renders: bool = False,
    shown: int = 1,
    seed: int = 0,
    title: str = "edit",
) -> Updated:
    """Edit a field by editing its training views, which it learns from as they are then.

    Args:
        learner: with the field, and how it learns.
        images: training views, which stay as they are.
        guidance: edits views.
        instruction: to the guidance.
        schedule: of edits and iterations.
        keeps_renders: edits stay close to views of the field as it was, as in DGE; or to the training views.
        shown: views that are returned, at most.
        seed: of all random numbers.
        title: of the progress bar.
    """
    instruction, generator = require_instruction(instruction), torch.Generator().manual_seed(seed)
    edits = _Edits(learner, images, guidance, instruction, keeps_renders, generator)
    losses: list[float] = []
    planned = progress(turns(schedule, len(images), generator), schedule.iterations, title=title, unit="step")
    for iteration, turn in enumerate(planned):
        if turn.edited:
            edits.make(turn.edited, turn.level)
        losses.append(learner.step(edits.images, turn.learned, generator))
        if not isfinite(losses[-1]):
            raise FitError(
                f"iteration {iteration}: expected a finite loss, got {losses[-1]}; lower the rates"
            )
    return Updated(learner.field, edits.some(shown), losses, edits.count, edits.seconds)


class _Edits:
    """The views that are learned from, as they are edited."""

    def __init__(
        self,
        learner: Learner,
        images: Images,
        guidance: Guidance,
        instruction: str,
        keeps_renders: bool,
        generator: torch.Generator,
    ) -> None:
        self.learner, self.guidance, self.instruction = learner, guidance, instruction
        self.generator = generator
        self.before, self.images = images, replace(images, planes=images.planes.clone())
        self.original = learner.original if keeps_renders else None
        self.edited: set[int] = set()
        self.count, self.seconds = 0, 0.0

    @torch.no_grad()
    def make(self, ids: Sequence[int], level: float) -> None:
        """Edit some views together, as the field shows them now."""
        start, field = time.monotonic(), self.learner.field
        ids = sorted(ids, key=lambda view: azimuth(self.images.cameras[view]))  # those that follow are alike
        cameras = [self.images.cameras[view].to(field.device) for view in ids]
        conditions = torch.stack([self._condition(view) for view in ids]).to(field.device)
        views = field_views(field, cameras, conditions, level)
        guided = self.guidance(views, self.instruction, self.generator)
        for view, image in zip(ids, require_edited(guided, views, self.guidance.name), strict=True):
            self.images.planes[view, :3] = image.permute(2, 0, 1).mul(255).round().to(torch.uint8)
        self.edited.update(ids)
        self.count, self.seconds = self.count + len(ids), self.seconds + time.monotonic() - start

    def _condition(self, view: int) -> Tensor:
        """What edits of a view stay close to [H, W, 3]: how it was before the first of them."""
        if self.original is None:
            return self.before.target(view).color
        return (
            self.original.render(self.before.cameras[view].to(self.original.device)).color.clamp(0, 1).cpu()
        )

    @torch.no_grad()
    def some(self, count: int) -> list[tuple[Tensor, Tensor]]:
        """So many views that were edited, as they were and as they are, at most."""
        ids = sorted(self.edited)
        chosen = ids[:: max(1, len(ids) // count)][:count]
        return [(self._condition(view), self.images.target(view).color) for view in chosen]


def azimuth(camera: Camera) -> float:
    """Angle of a camera around the world's y axis, radians."""
    x, _, z = camera.position.tolist()
    return atan2(z, x)


@torch.no_grad()
def field_views(
    field: Field, cameras: Sequence[Camera], conditions: Tensor, level: float | None = None
) -> EditViews:
    """Render views of a field for a guidance.

    Points are those of the mean depth, and normals those of the surface that they make: fields without
    surfaces have no others.

    Args:
        field: that can render depth.
        cameras: of one size, on the field's device.
        conditions: [V, H, W, 3] what edits stay close to.
        level: of noise, see `EditViews`.
    """
    images, alphas, points, normals = [], [], [], []
    for camera in cameras:
        seen = field.render(camera, outputs=("depth",))
        assert seen.depth is not None
        images.append(seen.color.clamp(0, 1))
        alphas.append(seen.alpha)
        points.append(camera.unproject(seen.depth))
        is_seen = (seen.alpha > 0)[..., None]
        normals.append(depth_to_normal(seen.depth, camera.viewmat, camera.K) * is_seen)
    return EditViews(
        torch.stack(images),
        conditions,
        torch.stack(alphas),
        torch.stack(points),
        torch.stack(normals),
        list(cameras),
        level,
    )
