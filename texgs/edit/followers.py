"""How texels follow edited views: by solving for them, or by iterations of Adam."""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import torch
from torch import Tensor

from texgs.edit.back_projection import back_project, fill_unseen
from texgs.edit.exposures import Exposure
from texgs.edit.target_adam import Reconstruction
from texgs.edit.target_solve import solve
from texgs.fields.optimizer import Rate
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.texels import bare_colors


class Follower(Protocol):
    """Finds bare colours for exposures, round after round."""

    def follow(self, rows: list[list[Exposure]], title: str) -> Tensor:
        """Bare colours [T, 3] for what is wanted now; for each opacity a row of exposures."""

    def finish(self, rows: list[list[Exposure]]) -> tuple[Tensor, Tensor]:
        """Bare colours [T, 3] in the end, and how much each texel is seen [T]."""


class SolveFollower:
    """Texels that are the solution of a linear problem in every round."""

    def __init__(self, model: Surfels, sweeps: int, generator: torch.Generator) -> None:
        self.model, self.sweeps, self.generator = model, sweeps, generator

    def follow(self, rows: list[list[Exposure]], title: str) -> Tensor:
        """Bare colours [T, 3] for these exposures."""
        exposures = [exposure for row in rows for exposure in row]
        sums = back_project(exposures, self.model)
        start = fill_unseen(sums, self.model)
        self.weights = sums.weights
        self.colors = solve(
            exposures, self.model, sums, start, sweeps=self.sweeps, generator=self.generator, title=title
        )
        return self.colors

    def finish(self, rows: list[list[Exposure]]) -> tuple[Tensor, Tensor]:
        """Bare colours [T, 3] and how much each texel is seen [T]."""
        return self.colors, self.weights


class AdamFollower:
    """Texels on their way, from round to round."""

    def __init__(
        self, model: Surfels, iterations: int, rounds: int, rate: Rate, generator: torch.Generator
    ) -> None:
        self.model, self.count, self.generator = model, iterations, generator
        start = bare_colors(model).clamp(0, 1)
        self.reconstruction = Reconstruction(start, rate, rounds * iterations)

    def follow(self, rows: list[list[Exposure]], title: str) -> Tensor:
        """Bare colours [T, 3] after the iterations of a round."""
        self.reconstruction.run(rows, self.model, self.count, self.generator, title)
        return self.reconstruction.colors

    def finish(self, rows: list[list[Exposure]]) -> tuple[Tensor, Tensor]:
        """Bare colours [T, 3], made up where nothing is seen, and how much each texel is seen [T]."""
        sums = back_project([exposure for row in rows for exposure in row], self.model)
        return fill_unseen(replace(sums, colors=self.reconstruction.colors), self.model), sums.weights
