"""Rotations: quaternions wxyz and 3x3 matrices, both ways."""

import torch
from torch import Tensor
from torch.nn.functional import normalize

from texgs.core.errors import ShapeError


def quats_to_matrices(quats: Tensor) -> Tensor:
    """Turn quaternions into rotation matrices; columns are the rotated axes.

    Differentiable. A quaternion is normalised first, so its length does not matter unless it is zero.

    Args:
        quats: [..., 4] wxyz.

    Returns:
        [..., 3, 3] with `matrix @ vector` the rotated vector.

    Raises:
        ShapeError: if the last axis is not 4.
    """
    if quats.ndim < 1 or quats.shape[-1] != 4:
        raise ShapeError(f"quats: expected [..., 4], got {list(quats.shape)}")
    w, x, y, z = normalize(quats, dim=-1).unbind(-1)
    entries = (
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
        2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
    )  # fmt: skip
    return torch.stack(entries, dim=-1).reshape(*quats.shape[:-1], 3, 3)


def matrices_to_quats(matrices: Tensor) -> Tensor:
    """Turn rotation matrices into unit quaternions wxyz with w >= 0.

    Differentiable. Of the four ways to take the square root the best conditioned is used for each matrix
    (Shepperd 1978), so half turns are as exact as small angles.

    Args:
        matrices: [..., 3, 3] rotations; a reflection or a sheared matrix gives a meaningless result.

    Returns:
        [..., 4] wxyz.

    Raises:
        ShapeError: if the last axes are not 3 x 3.
    """
    if matrices.shape[-2:] != (3, 3):
        raise ShapeError(f"matrices: expected [..., 3, 3], got {list(matrices.shape)}")
    m = [[matrices[..., row, column] for column in range(3)] for row in range(3)]
    trace = m[0][0] + m[1][1] + m[2][2]
    squares = torch.stack([trace, m[0][0], m[1][1], m[2][2]], dim=-1)  # [..., 4], (4 q_i^2 - 1) in disguise
    # Row i holds 4 q_i (w, x, y, z): every row is the quaternion up to its length.
    wx, wy, wz = m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]
    xy, xz, yz = m[1][0] + m[0][1], m[0][2] + m[2][0], m[2][1] + m[1][2]
    ww, xx, yy, zz = 1 + trace, *(1 + 2 * m[i][i] - trace for i in range(3))
    rows = torch.stack([ww, wx, wy, wz, wx, xx, xy, xz, wy, xy, yy, yz, wz, xz, yz, zz], dim=-1)
    rows = rows.reshape(*matrices.shape[:-2], 4, 4)
    best = squares.argmax(dim=-1, keepdim=True)[..., None].expand(*squares.shape[:-1], 1, 4)
    quats = normalize(rows.gather(-2, best).squeeze(-2), dim=-1)
    return torch.where(quats[..., :1] < 0, -quats, quats)
