"""Rotations of quaternions, nearest points, and an order that keeps neighbours in space near in memory."""

import torch
from torch import Tensor
from torch.nn.functional import normalize

from texgs.core.errors import ShapeError

BITS = 10  # bits of each coordinate in a box: cells of a thousandth of its sides


def quats_to_matrices(quats: Tensor) -> Tensor:
    """Return the rotation matrices [..., 3, 3] of quaternions [..., 4] wxyz; columns are the rotated axes.

    Differentiable. A quaternion is normalised first, so its length does not matter unless it is zero.
    """
    from kornia.geometry.conversions import quaternion_to_rotation_matrix

    if quats.ndim < 1 or quats.shape[-1] != 4:
        raise ShapeError(f"quats: expected [..., 4], got {list(quats.shape)}")
    matrices: Tensor = quaternion_to_rotation_matrix(quats)
    return matrices


def facing(normals: Tensor) -> Tensor:
    """Return quaternions [N, 4] wxyz that turn the z axis to normals [N, 3], on the shortest way."""
    x, y, z = normalize(normals, dim=1).unbind(dim=1)
    turned = torch.stack([1 + z, -y, x, torch.zeros_like(z)], dim=1)
    around_x = normals.new_tensor([0.0, 1.0, 0.0, 0.0])  # half a turn, as all ways to -z are equally short
    return normalize(torch.where((1 + z < 1e-6)[:, None], around_x, turned), dim=1)


def nearest(points: Tensor, places: Tensor, count: int | None = None) -> tuple[Tensor, Tensor]:
    """Return distances, float64, and indices of the point [N, 3] nearest to each place [M, 3], both [M].

    Given a count, of so many points [M, count], the nearest first. The results are on the CPU.
    """
    from scipy.spatial import cKDTree

    tree, where = (x.detach().cpu().numpy() for x in (points, places))
    found = cKDTree(tree).query(where, k=1 if count is None else range(1, count + 1))
    distances, indices = map(torch.from_numpy, found)
    return distances, indices


def z_order(cells: Tensor) -> Tensor:
    """Return the order [N], int64, of cells [N, D] along a Z curve (Morton 1966); equal ones keep theirs.

    Cells are whole numbers of 0 or more; D times their bits have to fit into 63.
    """
    axes = cells.shape[1]
    code = cells.new_zeros(len(cells), dtype=torch.long)
    bits = int(cells.max()).bit_length() if len(cells) else 0
    for bit in range(bits):
        for axis in range(axes):
            code |= (cells[:, axis].long() >> bit & 1) << (axes * bit + axis)
    return code.argsort(stable=True)


def z_order_of(points: Tensor) -> Tensor:
    """Return the order [N] of points [N, D] along a Z curve through the cells of their bounding box."""
    if not len(points):
        return points.new_zeros(0, dtype=torch.long)
    low, high = points.aminmax(dim=0)
    cells = (points - low) / (high - low).clamp_min(torch.finfo(points.dtype).tiny) * (2**BITS - 1)
    return z_order(cells.long())
