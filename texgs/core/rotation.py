"""Rotation matrices of quaternions wxyz."""

from torch import Tensor

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
    from kornia.geometry.conversions import quaternion_to_rotation_matrix

    if quats.ndim < 1 or quats.shape[-1] != 4:
        raise ShapeError(f"quats: expected [..., 4], got {list(quats.shape)}")
    matrices: Tensor = quaternion_to_rotation_matrix(quats)
    return matrices
