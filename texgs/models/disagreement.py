"""A guidance whose views do not agree: what an editor of single images does to views of one scene.

With it, methods that edit all views again and again can be compared with those that edit a few views once,
on machines without a diffusion model.
"""

from __future__ import annotations

from dataclasses import replace

import torch
from torch import Tensor

from texgs.core.errors import ArgumentError
from texgs.models.guidance import EditViews, Guidance, require_edited


class Disagreeing:
    """Another guidance, whose patterns lie elsewhere and whose colours are off in each view of each call.

    Args:
        guidance: that edits.
        amount: standard deviation of shifts of patterns, world units, and of factors on colours.

    Raises:
        ArgumentError: if the amount is below 0.
    """

    def __init__(self, guidance: Guidance, amount: float) -> None:
        if not amount >= 0:
            raise ArgumentError(f"disagreement: expected 0 or more, got {amount}")
        self.guidance, self.amount = guidance, amount
        self.name, self.lit = f"{guidance.name} that disagree by {amount:g}", guidance.lit

    def __call__(self, views: EditViews, instruction: str, generator: torch.Generator) -> Tensor:
        """Edited images [V, H, W, 3] over white; see `Guidance`."""
        shifts, gains = self.amount * torch.randn(2, len(views), 1, 1, 3, generator=generator).to(
            views.images
        )
        moved = replace(views, points=views.points + shifts)
        edited = require_edited(self.guidance(moved, instruction, generator), views, self.guidance.name)
        behind = 1 - views.alphas[..., None]  # white
        return ((edited - behind) * (1 + gains) + behind).clamp(0, 1)
