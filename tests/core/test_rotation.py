from math import cos, pi, sin

import pytest
import torch

from texgs.core.errors import ShapeError
from texgs.core.rotation import quats_to_matrices


def random_quats(n, seed=0):
    generator = torch.Generator().manual_seed(seed)
    return torch.randn(n, 4, generator=generator, dtype=torch.float64)


def test_quarter_turn_about_z_takes_x_to_y():
    matrix = quats_to_matrices(torch.tensor([cos(pi / 4), 0.0, 0.0, sin(pi / 4)], dtype=torch.float64))
    expected = torch.tensor([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], dtype=torch.float64)
    torch.testing.assert_close(matrix, expected, atol=1e-15, rtol=0)


def test_matrices_are_rotations_whatever_the_length():
    matrices = quats_to_matrices(5 * random_quats(100))
    eye = torch.eye(3, dtype=torch.float64).expand(100, 3, 3)
    torch.testing.assert_close(matrices @ matrices.mT, eye, atol=1e-14, rtol=0)
    torch.testing.assert_close(torch.linalg.det(matrices), torch.ones(100, dtype=torch.float64))


def test_product_of_matrices_is_hamilton_product():
    p, q = random_quats(1)[0], random_quats(1, seed=1)[0]
    product = torch.cat(
        [p[:1] * q[:1] - p[1:] @ q[1:], p[0] * q[1:] + q[0] * p[1:] + torch.linalg.cross(p[1:], q[1:])]
    )
    torch.testing.assert_close(quats_to_matrices(product), quats_to_matrices(p) @ quats_to_matrices(q))


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_half_turns(axis):
    quat = torch.zeros(4, dtype=torch.float64)
    quat[1 + axis] = 1
    expected = -torch.ones(3, dtype=torch.float64)
    expected[axis] = 1
    torch.testing.assert_close(quats_to_matrices(quat), torch.diag(expected))


def test_gradients():
    assert torch.autograd.gradcheck(quats_to_matrices, random_quats(20).requires_grad_())


def test_wrong_shapes():
    with pytest.raises(ShapeError, match=r"quats: expected \[\.\.\., 4\], got \[2, 3\]"):
        quats_to_matrices(torch.zeros(2, 3))
