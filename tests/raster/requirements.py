"""What tests require: the same bits on any number of threads."""

from collections.abc import Mapping

import torch


def with_threads(n, function, *arguments):
    """Return what function(*arguments) does while torch, and the library with it, uses n threads."""
    before = torch.get_num_threads()
    torch.set_num_threads(n)
    try:
        results = function(*arguments)
    finally:
        torch.set_num_threads(before)
    return results if isinstance(results, Mapping) else dict(enumerate(results))


def require_same_bits(function, *arguments, threads=(2, 7)):
    """Require that a function gives the same tensors, in a list or by name, for any number of threads."""
    alone = with_threads(1, function, *arguments)
    for n in threads:
        for name, value in with_threads(n, function, *arguments).items():
            assert torch.equal(value, alone[name]), f"{name} with {n} threads"


def require_equal(results, expected):
    """Require the same tensors by name, bit for bit."""
    assert results.keys() == expected.keys()
    for name, value in expected.items():
        assert torch.equal(results[name], value), name
