"""The Z curve: an order in which what is near in space is mostly near in memory."""

import torch
from torch import Tensor

BITS = 10  # of each coordinate of places in a box: cells of a thousandth of its sides


def z_order(cells: Tensor) -> Tensor:
    """Return the order of cells along a Z curve (Morton 1966); equal ones keep theirs.

    Args:
        cells: [N, D] whole numbers of 0 or more; D times their bits have to fit into 63.

    Returns:
        [N] indices, int64.
    """
    axes = cells.shape[1]
    code = cells.new_zeros(len(cells), dtype=torch.long)
    bits = int(cells.max()).bit_length() if len(cells) else 0
    for bit in range(bits):
        for axis in range(axes):
            code |= (cells[:, axis].long() >> bit & 1) << (axes * bit + axis)
    return code.argsort(stable=True)


def z_order_of(places: Tensor) -> Tensor:
    """Return order [N] of places in space [N, D] along a Z curve through the cells of their bounding box."""
    if not len(places):
        return places.new_zeros(0, dtype=torch.long)
    low, high = places.aminmax(dim=0)
    cells = (places - low) / (high - low).clamp_min(torch.finfo(places.dtype).tiny) * (2**BITS - 1)
    return z_order(cells.long())
