"""The interface of all editors of views, and a wrapper that makes one inconsistent."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError


@dataclass(frozen=True, eq=False)
class EditViews:
    """Views of one scene to be edited together; all of one size, on one device, over white."""

    images: Tensor  # [V, H, W, 3] current renders of the scene, in [0, 1]
    conditions: Tensor  # [V, H, W, 3] the scene before this run; edits should stay close to it
    alphas: Tensor  # [V, H, W] in [0, 1]
    points: Tensor  # [V, H, W, 3] world position at a pixel; undefined where alpha is 0
    normals: Tensor  # [V, H, W, 3] world axes, facing the camera; 0 where alpha is 0
    cameras: Sequence[Camera]  # one for each view
    level: float | None = None
    """Share of the noise schedule that images are noised to before they are edited, 0 to 1: how far from them
    an edit may go. By default as the guidance does; filters take no notice."""

    def __post_init__(self) -> None:
        size = check.shape("images", self.images, "V H W 3")
        if len(self.cameras) != size["V"]:
            raise ArgumentError(f"cameras: expected {size['V']} as images, got {len(self.cameras)}")
        if self.level is not None and not 0 <= self.level <= 1:
            raise ArgumentError(f"level: expected a share of the noise from 0 to 1, got {self.level}")
        check.shape("alphas", self.alphas, "V H W", **size)
        for name in ("conditions", "points", "normals"):
            check.shape(name, getattr(self, name), "V H W 3", **size)

    def __len__(self) -> int:
        return len(self.images)


class Guidance(Protocol):
    """Edits views as an instruction says."""

    name: str  # for reports and metadata
    lit: bool  # whether it expects renders with light, or bare colours

    def __call__(self, views: EditViews, instruction: str, generator: torch.Generator) -> Tensor:
        """Return the edited images [V, H, W, 3] over white.

        The generator, on the CPU, determines all random numbers.
        """


def require_edited(edited: Tensor, views: EditViews, name: str) -> Tensor:
    """Require edited images of the views' size, and return them clamped to [0, 1] on the views' device."""
    count, height, width, _ = views.images.shape
    check.shape(f"images edited by {name}", edited, "V H W 3", V=count, H=height, W=width)
    check.finite(**{f"images edited by {name}": edited})
    return edited.to(views.images).clamp(0, 1)


class Disagreeing:
    """A guidance with random shifts of patterns and colours in each view of each call.

    It does what an editor of single images does to views of one scene. With it, methods that edit all views
    again and again can be compared with those that edit a few once, without a diffusion model. The amount is
    the standard deviation of shifts of patterns, world units, and of factors on colours.
    """

    def __init__(self, guidance: Guidance, amount: float) -> None:
        if not amount >= 0:
            raise ArgumentError(f"disagreement: expected 0 or more, got {amount}")
        self.guidance, self.amount = guidance, amount
        self.name, self.lit = f"{guidance.name} that disagree by {amount:g}", guidance.lit

    def __call__(self, views: EditViews, instruction: str, generator: torch.Generator) -> Tensor:
        """Return edited images [V, H, W, 3] over white; see `Guidance`."""
        shifts, gains = self.amount * torch.randn(2, len(views), 1, 1, 3, generator=generator).to(
            views.images
        )
        moved = replace(views, points=views.points + shifts)
        edited = require_edited(self.guidance(moved, instruction, generator), views, self.guidance.name)
        behind = 1 - views.alphas[..., None]  # white
        return ((edited - behind) * (1 + gains) + behind).clamp(0, 1)
