"""When which views are edited while a field learns from them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from texgs.core.errors import ArgumentError


@dataclass(frozen=True)
class UpdateSchedule:
    """Rounds of edits, and the iterations after each.

    A round edits some views, `group` of them together before each of its first iterations, until all of
    them are edited.
    """

    rounds: int
    period: int  # iterations of a round
    views: int | None = None  # edited in a round; None: all
    group: int = 1  # edited together
    order: Literal["next", "random"] = "next"  # going on where the last round ended, or drawn at random
    learned: Literal["all", "newest", "round"] = "all"  # views: any, the one just edited, or the round's
    levels: Sequence[tuple[float, float]] = ((1.0, 1.0),)  # from and to, by round; the last holds on

    @property
    def iterations(self) -> int:
        """Return how many all rounds have."""
        return self.rounds * self.period


def noise_range(where: str, noise: Sequence[float]) -> tuple[tuple[float, float], ...]:
    """Return one range of noise for all rounds."""
    if len(noise) != 2 or not 0 <= noise[0] <= noise[1] <= 1:
        raise ArgumentError(f"{where}: expected two shares from 0 to 1, the smaller one first, got {noise}")
    return ((noise[0], noise[1]),)
