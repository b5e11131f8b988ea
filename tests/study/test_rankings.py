"""Counts and tests against votes of known preferences and closed forms."""

from math import comb

import numpy as np
import pytest
from scipy.stats import friedmanchisquare

from texgs.study.rankings import Rankings, firsts, friedman, interval, pool

METHODS = tuple("abcd")
WEIGHTS = np.array([4.0, 2.0, 1.0, 0.5])


def plackett_luce(weights, count, seed):
    """Rankings [count, M] that choose the best in proportion to weights, then the next among the rest.

    The order of log weights with Gumbel noise is distributed so (Yellott 1977).
    """
    noise = np.random.default_rng(seed).gumbel(size=(count, len(weights)))
    return (-(np.log(weights) + noise)).argsort(axis=1).argsort(axis=1) + 1


def test_known_preferences_are_recovered():
    votes = Rankings.of(METHODS, plackett_luce(WEIGHTS, 4000, seed=1))
    assert votes.number == 4000
    assert votes.counts.sum(axis=0).tolist() == votes.counts.sum(axis=1).tolist() == [4000] * 4
    assert votes.means.tolist() == sorted(votes.means)
    expected = WEIGHTS / WEIGHTS.sum()
    for share, truth in zip(firsts(votes), expected, strict=True):
        low, high = interval(share)
        assert share.statistic == pytest.approx(truth, abs=4 * 0.5 / 4000**0.5)  # four standard deviations
        assert low < share.statistic < high
        assert share.pvalue < 1e-6 or truth == pytest.approx(0.25, abs=0.02)
    assert friedman(votes) == tuple(friedmanchisquare(*votes.ranks.T))
    assert friedman(votes)[1] < 1e-100


def binomial(first, number, share):
    return comb(number, first) * share**first * (1 - share) ** (number - first)


def test_the_share_of_first_ranks_is_tested_exactly():
    counts = np.array([[27, 7, 3, 3], [5, 11, 16, 8], [8, 9, 11, 12], [0, 13, 10, 17]])
    for share, first in zip(firsts(Rankings(METHODS, counts)), (27, 5, 8, 0), strict=True):
        seen = binomial(first, 40, 0.25)
        others = [binomial(k, 40, 0.25) for k in range(41)]
        low, high = interval(share)
        assert share.pvalue == pytest.approx(min(1, sum(x for x in others if x <= seen * (1 + 1e-7))))
        above = sum(binomial(k, 40, low) for k in range(first, 41))
        assert (above == pytest.approx(0.025)) if first else (low == 0)
        assert sum(binomial(k, 40, high) for k in range(first + 1)) == pytest.approx(0.025)


def test_two_methods_or_counts_alone_have_no_friedman_test():
    assert friedman(Rankings.of("ab", np.array([[1, 2], [2, 1]]))) is None
    assert friedman(Rankings(METHODS, np.eye(4, dtype=int))) is None


def test_votes_are_put_together_in_one_order():
    one = Rankings.of("ab", np.array([[1, 2]]))
    other = Rankings.of("ba", np.array([[1, 2]])).sorted("ab")
    both = pool([one, other])
    assert both.counts.tolist() == [[1, 1], [1, 1]]
    assert both.ranks.tolist() == [[1, 2], [2, 1]]
    assert pool([one, Rankings("ab", np.eye(2, dtype=int))]).ranks is None
