"""Running a function on a number of threads."""

import torch


def with_threads(n, function, *arguments):
    """What function(*arguments) returns while torch, and the library with it, uses n threads."""
    before = torch.get_num_threads()
    torch.set_num_threads(n)
    try:
        return function(*arguments)
    finally:
        torch.set_num_threads(before)
