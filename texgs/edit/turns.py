"""Which views are edited when, and which are learned from: all methods that edit views again and again."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import ceil
from typing import Literal

import torch

from texgs.core.errors import ArgumentError

Order = Literal["next", "random"]
Learned = Literal["all", "newest", "round"]


@dataclass(frozen=True)
class Schedule:
    """Rounds of edits, and the iterations after each.

    A round edits some views, `group` of them together before each of its first iterations, until all have
    had their turn.

    Raises:
        ArgumentError: naming the value that is out of range.
    """

    rounds: int
    period: int  # iterations of a round
    views: int | None = None  # edited in a round; None: all
    group: int = 1  # edited together
    order: Order = "next"  # one after the other, going on where the last round ended; or drawn at random
    learned: Learned = "all"  # from any view, from the one that was just edited, from those of the round
    levels: tuple[tuple[float, float], ...] = (
        (1.0, 1.0),
    )  # of noise, from and to, by round; the last holds on

    def __post_init__(self) -> None:
        for name in ("rounds", "period", "views", "group"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise ArgumentError(f"{name}: expected at least 1, got {value}")
        if not self.levels or not all(0 <= low <= high <= 1 for low, high in self.levels):
            raise ArgumentError(f"levels: expected ranges from 0 to 1, at least one, got {self.levels}")

    @property
    def iterations(self) -> int:
        """Of all rounds."""
        return self.rounds * self.period


@dataclass(frozen=True)
class Turn:
    """One iteration."""

    edited: Sequence[int]  # views to edit before it, together
    level: float  # of noise, a share of the schedule
    learned: Sequence[int]  # views that it may learn from


def turns(schedule: Schedule, count: int, generator: torch.Generator) -> Iterator[Turn]:
    """All iterations on so many views.

    Args:
        schedule: of edits.
        count: of views.
        generator: of views and levels of noise.
    """
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
        yield Turn(edited, level, learned[schedule.learned])
