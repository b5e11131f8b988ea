"""Counts and tests against votes of known preferences, closed forms and permutations."""

from math import comb

import numpy as np
import pytest
from scipy.stats import friedmanchisquare

from texgs.study.rankings import Rankings, firsts, friedman, interval, pooled

METHODS = tuple("abcd")
WEIGHTS = np.array([4.0, 2.0, 1.0, 0.5])


def plackett_luce(weights, count, seed):
    """Rankings [count, M] that choose the best in proportion to weights, then the next among the rest.

    The order of log weights with Gumbel noise is distributed so (Yellott 1977).
    """
    noise = np.random.default_rng(seed).gumbel(size=(count, len(weights)))
    return (-(np.log(weights) + noise)).argsort(axis=1).argsort(axis=1) + 1


def statistic(ranks):
    """Friedman's statistic of rankings [..., B, M] without ties, as he defines it."""
    blocks, methods = ranks.shape[-2:]
    squares = (ranks.sum(axis=-2) ** 2).sum(axis=-1)
    return 12 * squares / (blocks * methods * (methods + 1)) - 3 * blocks * (methods + 1)


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
    assert friedman(votes)[1] < 1e-100


def test_friedman_is_scipys_and_agrees_with_permutations():
    ranks = plackett_luce([1.5, 1.2, 1.0, 0.9], 60, seed=3)
    value, p = friedman(Rankings.of(METHODS, ranks))
    assert (value, p) == tuple(friedmanchisquare(*ranks.T))
    assert value == pytest.approx(statistic(ranks))
    shuffled = np.random.default_rng(4).random((20_000, 60, 4)).argsort(axis=2) + 1
    brute = (statistic(shuffled) >= statistic(ranks) - 1e-9).mean()
    assert 0.01 < brute < 0.5, "a p value that says something"
    assert p == pytest.approx(brute, abs=0.015)  # permutations: 0.0035; the chi-squared: about 1 / 60


def test_p_values_of_random_votes_are_uniform():
    fair = np.ones(4)
    votes = [Rankings.of(METHODS, plackett_luce(fair, 40, seed)) for seed in range(400)]
    p = np.array([friedman(each)[1] for each in votes])
    assert abs((p < 0.05).mean() - 0.05) < 0.035  # three standard deviations of 400 draws
    assert abs(np.median(p) - 0.5) < 0.08
    first = [firsts(each)[0] for each in votes]
    held = np.mean([low <= 0.25 <= high for low, high in map(interval, first)])
    assert held >= 0.94, "an exact interval holds at least 95 percent"
    assert np.mean([each.pvalue < 0.05 for each in first]) <= 0.08, "and an exact test rejects at most 5"


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
    both = pooled([one, other])
    assert both.counts.tolist() == [[1, 1], [1, 1]]
    assert both.ranks.tolist() == [[1, 2], [2, 1]]
    assert pooled([one, Rankings("ab", np.eye(2, dtype=int))]).ranks is None
