"""Alternate between editing the views of a field and learning from them (IN2N, Instruct-GS2GS, DGE)."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from math import atan2, ceil, isfinite
from typing import NamedTuple, Protocol

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError, FitError
from texgs.core.progress import progress
from texgs.edit.objective import LOSS_SCALE
from texgs.edit.observations import edit_views
from texgs.edit.recipe import UpdateSchedule
from texgs.fields.field import Field
from texgs.models.guidance import EditViews, Guidance, require_edited
from texgs.models.instruction import require_instruction
from texgs.models.lpips import Lpips
from texgs.raster.losses import l1_dssim
from texgs.volume.images import Images


class Learner(Protocol):
    """A field that learns from views."""

    @property
    def original(self) -> Field:
        """Return the field before the edit."""

    @property
    def field(self) -> Field:
        """Return the current field."""

    def step(self, images: Images, views: Sequence[int], generator: torch.Generator) -> float:
        """Learn from some of these views, all that memory and method allow; return the loss."""


@dataclass(frozen=True, eq=False)
class PhotometricLoss:
    """The distance of images from their edited targets: a weighted sum of L1, D-SSIM and LPIPS."""

    l1: float
    dssim: float
    lpips: float = 0.0
    network: Lpips | None = None  # for LPIPS

    def __call__(self, image: Tensor, wanted: Tensor) -> Tensor:
        """Return the weighted sum of mean differences [] to a wanted image, differentiable in the image.

        Both are [H, W, 3] in planar memory; or patches [N, H, W, 3] where D-SSIM has no weight.
        """
        pixels = self.l1 + self.dssim
        loss = image.new_zeros(())
        if self.dssim:
            loss = pixels * l1_dssim(image, wanted, self.dssim / pixels)
        elif self.l1:
            loss = self.l1 * (image - wanted).abs().mean()
        if self.lpips and self.network is not None:
            loss = loss + self.lpips * self.network.distance(image, wanted)
        return loss

    def with_gradient(self, image: Tensor, wanted: Tensor) -> tuple[float, Tensor]:
        """Return the loss, and its gradient by the image, of the image's shape."""
        leaf = image.detach().requires_grad_()
        loss = self(leaf, wanted)
        (gradient,) = torch.autograd.grad(LOSS_SCALE * loss, leaf)
        return float(loss.detach()), gradient / LOSS_SCALE


class UpdateStep(NamedTuple):
    """One iteration."""

    edited: Sequence[int]  # views to edit before it, together
    level: float  # noise, as a share of the schedule
    learned: Sequence[int]  # views that it may learn from


def update_steps(schedule: UpdateSchedule, count: int, generator: torch.Generator) -> Iterator[UpdateStep]:
    """Yield all iterations on `count` views; views and noise levels are drawn at random."""
    size, following = min(schedule.views or count, count), 0
    least = ceil(size / schedule.group)
    if schedule.period < least:
        raise ArgumentError(
            f"schedule: expected rounds of at least {least} iterations, in which {size} views are edited, "
            f"got {schedule.period}; make rounds longer or edit fewer views in each"
        )
    for iteration in range(schedule.iterations):
        round_, place = divmod(iteration, schedule.period)
        if place == 0:
            if schedule.order == "random":
                chosen = torch.randperm(count, generator=generator)[:size].sort().values.tolist()
            else:
                chosen = [(following + k) % count for k in range(size)]
                following = (following + size) % count
        low, high = schedule.levels[min(round_, len(schedule.levels) - 1)]
        level = low + (high - low) * float(torch.rand((), generator=generator))
        edited = chosen[place * schedule.group : (place + 1) * schedule.group]
        learned = {"all": range(count), "newest": edited or range(count), "round": chosen}
        yield UpdateStep(edited, level, learned[schedule.learned])


def update_field(
    learner: Learner,
    images: Images,
    guidance: Guidance,
    instruction: str,
    schedule: UpdateSchedule,
    *,
    keeps_renders: bool = False,
    seed: int = 0,
    title: str = "edit",
) -> Updated:
    """Edit a field by editing its training views while it learns from them.

    The given images stay unchanged. With `keeps_renders`, edits stay close to renders of the original field,
    as in DGE, otherwise to the training views. The seed determines all random numbers.
    """
    generator = torch.Generator().manual_seed(seed)
    updated = Updated(
        *(learner, images, replace(images, planes=images.planes.clone()), guidance),
        *(require_instruction(instruction), keeps_renders, generator),
    )
    steps = update_steps(schedule, len(images), generator)
    for iteration, step in enumerate(progress(steps, schedule.iterations, title=title, unit="step")):
        if step.edited:
            updated.edit(step.edited, step.level)
        loss = learner.step(updated.images, step.learned, generator)
        updated.losses.append(loss)
        if not isfinite(loss):
            raise FitError(f"iteration {iteration}: expected a finite loss, got {loss}; lower the rates")
    return updated


@dataclass(eq=False)
class Updated:
    """A field and its training views during an edit."""

    learner: Learner
    before: Images
    images: Images
    guidance: Guidance
    instruction: str
    keeps_renders: bool
    generator: torch.Generator
    losses: list[float] = field(default_factory=list)  # in each iteration
    edited: set[int] = field(default_factory=set)
    count: int = 0  # edits of single views
    seconds: float = 0.0  # the time of all edits

    @torch.no_grad()
    def edit(self, ids: Sequence[int], level: float) -> None:
        """Edit current renders of some views together."""
        start, shown = time.monotonic(), self.learner.field
        ids = sorted(ids, key=lambda view: azimuth(self.images.cameras[view]))  # neighbours are alike
        cameras = [self.images.cameras[view].to(shown.device) for view in ids]
        conditions = torch.stack([self._condition(view) for view in ids]).to(shown.device)
        views = field_views(shown, cameras, conditions, level)
        guided = self.guidance(views, self.instruction, self.generator)
        for view, image in zip(ids, require_edited(guided, views, self.guidance.name), strict=True):
            self.images.planes[view, :3] = image.permute(2, 0, 1).mul(255).round().to(torch.uint8)
        self.edited.update(ids)
        self.count, self.seconds = self.count + len(ids), self.seconds + time.monotonic() - start

    def _condition(self, view: int) -> Tensor:
        """Return the image [H, W, 3] that edits of a view stay close to: the view before the first edit."""
        if not self.keeps_renders:
            return self.before.target(view).color
        original = self.learner.original
        return original.render(self.before.cameras[view].to(original.device)).color.clamp(0, 1).cpu()

    @torch.no_grad()
    def some(self, count: int) -> list[tuple[Tensor, Tensor]]:
        """Return up to `count` edited views, each before and after."""
        ids = sorted(self.edited)
        chosen = ids[:: max(1, len(ids) // count)][:count]
        return [(self._condition(view), self.images.target(view).color) for view in chosen]


def azimuth(camera: Camera) -> float:
    """Return the angle of a camera around the world's y axis, radians."""
    x, _, z = camera.position.tolist()
    return atan2(z, x)


@torch.no_grad()
def field_views(
    field: Field, cameras: Sequence[Camera], conditions: Tensor, level: float | None = None
) -> EditViews:
    """Render views of a field for a guidance, see `edit_views`; `level` is of noise, see `EditViews`."""
    renders = [field.render(camera, outputs=("depth",)) for camera in cameras]
    return edit_views(renders, cameras, conditions, level)
