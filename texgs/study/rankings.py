"""Counts of rankings of the same methods by several people, and their statistical tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from texgs.study.questions import Compared

CONFIDENCE = 0.95  # level of intervals


@dataclass(frozen=True, eq=False)
class Rankings:
    """Votes on one data set, or on several."""

    methods: Sequence[Compared]
    counts: np.ndarray  # [M, M] votes by method and rank; the best rank is first
    ranks: np.ndarray | None = None  # [B, M] of each method in each ranking, if known

    @classmethod
    def of(cls, methods: Sequence[Compared], ranks: np.ndarray) -> Rankings:
        """Count rankings [B, M] from 1, the best, to M."""
        places = np.arange(1, len(methods) + 1)
        return cls(methods, (ranks[:, :, None] == places).sum(axis=0), ranks)

    @property
    def number(self) -> int:
        """Return the number of rankings."""
        return int(self.counts[0].sum())

    @property
    def means(self) -> np.ndarray:
        """Return the mean rank of each method, [M]."""
        return self.counts @ np.arange(1, len(self.methods) + 1) / self.number

    def sorted(self, methods: Sequence[Compared]) -> Rankings:
        """Return the same votes with the methods in another order."""
        order = [self.methods.index(method) for method in methods]
        return Rankings(methods, self.counts[order], None if self.ranks is None else self.ranks[:, order])


def pool(several: Sequence[Rankings]) -> Rankings:
    """Return all votes of rankings of the same methods in the same order."""
    known = [each.ranks for each in several if each.ranks is not None]
    ranks = np.concatenate(known) if len(known) == len(several) else None
    return Rankings(several[0].methods, np.sum([each.counts for each in several], axis=0), ranks)


def firsts(votes: Rankings) -> list[Any]:
    """Test the share of first ranks of each method exactly, against equal shares."""
    from scipy.stats import binomtest  # slow to import

    return [binomtest(first, votes.number, 1 / len(votes.methods)) for first in votes.counts[:, 0].tolist()]


def interval(first: Any) -> tuple[float, float]:
    """Return the exact (Clopper-Pearson) interval of a share."""
    low, high = first.proportion_ci(CONFIDENCE, method="exact")
    return float(low), float(high)


def friedman(votes: Rankings) -> tuple[float, float] | None:
    """Return Friedman's statistic and p (chi-squared approximation) under equal ranks of all methods.

    Each ranking is a block. Two methods have none: their shares of first ranks say the same.
    """
    from scipy.stats import friedmanchisquare  # slow to import

    if votes.ranks is None or len(votes.methods) < 3:
        return None
    statistic, p = friedmanchisquare(*votes.ranks.T)
    return float(statistic), float(p)
