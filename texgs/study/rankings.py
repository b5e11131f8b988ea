"""Rankings of the same methods by several people, counted, and how far they are from chance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from texgs.study.questions import Compared

CONFIDENCE = 0.95  # of intervals


@dataclass(frozen=True, eq=False)
class Rankings:
    """Votes on one data set, or on several."""

    methods: Sequence[Compared]
    counts: np.ndarray  # [M, M] votes: of a method, a rank; the best is first
    ranks: np.ndarray | None = None  # [B, M] of each method in each ranking; None where only counts are known

    @classmethod
    def of(cls, methods: Sequence[Compared], ranks: np.ndarray) -> Rankings:
        """Count rankings [B, M] from 1, the best, to M."""
        places = np.arange(1, len(methods) + 1)
        return cls(methods, (ranks[:, :, None] == places).sum(axis=0), ranks)

    @property
    def number(self) -> int:
        """Of rankings."""
        return int(self.counts[0].sum())

    @property
    def means(self) -> np.ndarray:
        """Mean rank of each method, [M]."""
        return self.counts @ np.arange(1, len(self.methods) + 1) / self.number

    def sorted(self, methods: Sequence[Compared]) -> Rankings:
        """Return the same votes with the methods in another order."""
        order = [self.methods.index(method) for method in methods]
        return Rankings(methods, self.counts[order], None if self.ranks is None else self.ranks[:, order])


def together(several: Sequence[Rankings]) -> Rankings:
    """Return all votes of rankings of the same methods in the same order."""
    known = [each.ranks for each in several if each.ranks is not None]
    ranks = np.concatenate(known) if len(known) == len(several) else None
    return Rankings(several[0].methods, np.sum([each.counts for each in several], axis=0), ranks)


@dataclass(frozen=True)
class Share:
    """How often a method was the best."""

    share: float
    low: float  # of the exact (Clopper-Pearson) interval
    high: float
    p: float  # of the exact two-sided binomial test that it is as often the best as each other method


def firsts(votes: Rankings) -> list[Share]:
    """Return the share of first ranks of each method."""
    from scipy.stats import binomtest  # slow to import

    shares = []
    for first in votes.counts[:, 0].tolist():
        test = binomtest(first, votes.number, 1 / len(votes.methods))
        interval = test.proportion_ci(CONFIDENCE, method="exact")
        shares.append(Share(test.statistic, float(interval.low), float(interval.high), float(test.pvalue)))
    return shares


@dataclass(frozen=True)
class Friedman:
    """Friedman's test of whether all methods are ranked alike; p by its chi-squared approximation."""

    statistic: float
    p: float


def friedman(votes: Rankings) -> Friedman | None:
    """Compare three methods or more; None for two, whose shares of first ranks say the same.

    Args:
        votes: with their ranks, each ranking a block.
    """
    from scipy.stats import friedmanchisquare  # slow to import

    if votes.ranks is None or len(votes.methods) < 3:
        return None
    test = friedmanchisquare(*votes.ranks.T)
    return Friedman(float(test.statistic), float(test.pvalue))
