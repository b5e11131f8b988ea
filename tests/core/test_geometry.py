from math import cos, pi, sin

import torch
from hypothesis import given
from hypothesis import strategies as st

from tests.refusals import refused
from texgs.core.errors import ShapeError
from texgs.core.geometry import facing, quats_to_matrices, z_order, z_order_of


def random_quats(n, seed=0):
    generator = torch.Generator().manual_seed(seed)
    return torch.randn(n, 4, generator=generator, dtype=torch.float64)


def test_matrices_are_rotations_whatever_the_length():
    matrices = quats_to_matrices(5 * random_quats(100))
    eye = torch.eye(3, dtype=torch.float64).expand(100, 3, 3)
    torch.testing.assert_close(matrices @ matrices.mT, eye, atol=1e-14, rtol=0)
    torch.testing.assert_close(torch.linalg.det(matrices), torch.ones(100, dtype=torch.float64))


def test_product_of_matrices_is_hamilton_product_and_a_quarter_turn_about_z_takes_x_to_y():
    p, q = random_quats(1)[0], random_quats(1, seed=1)[0]
    vector = p[0] * q[1:] + q[0] * p[1:] + torch.linalg.cross(p[1:], q[1:])
    product = torch.cat([p[:1] * q[:1] - p[1:] @ q[1:], vector])
    torch.testing.assert_close(quats_to_matrices(product), quats_to_matrices(p) @ quats_to_matrices(q))
    matrix = quats_to_matrices(torch.tensor([cos(pi / 4), 0.0, 0.0, sin(pi / 4)], dtype=torch.float64))
    expected = torch.tensor([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], dtype=torch.float64)
    torch.testing.assert_close(matrix, expected, atol=1e-15, rtol=0)


def test_gradients_and_wrong_shapes():
    assert torch.autograd.gradcheck(quats_to_matrices, random_quats(20).requires_grad_())
    refused(lambda: quats_to_matrices(torch.zeros(2, 3)), "quats: ", ShapeError)


def code(cell):
    """Interleaved binary digits, the last axis first."""
    digits = [f"{coordinate:010b}" for coordinate in reversed(cell)]
    return int("".join("".join(each) for each in zip(*digits, strict=True)), 2)


@given(st.lists(st.tuples(*[st.integers(0, 1023)] * 3), max_size=40))
def test_cells_follow_the_interleaved_digits(cells):
    order = z_order(torch.tensor(cells, dtype=torch.long).reshape(-1, 3))
    assert order.tolist() == sorted(range(len(cells)), key=lambda i: (code(cells[i]), i))


def test_places_that_are_near_are_mostly_near_in_the_order():
    places = torch.rand(4096, 3, generator=torch.Generator().manual_seed(0)) * torch.tensor([1.0, 5.0, 0.2])
    relative = places / places.amax(0)
    steps, ordered = (x.diff(dim=0).norm(dim=1).median() for x in (relative, relative[z_order_of(places)]))
    assert ordered < 0.2 * steps


def test_places_in_a_plane_and_in_one_point_have_an_order():
    places = torch.tensor([[3.0, 1.0, 2.0], [0.0, 1.0, 0.0], [3.0, 1.0, 0.0]])
    assert z_order_of(places).tolist() == [1, 2, 0]
    assert z_order_of(places[:1].expand(3, 3)).tolist() == [0, 1, 2]
    assert z_order_of(places[:0]).tolist() == []


def test_quaternions_that_face_along_normals():
    generator = torch.Generator().manual_seed(0)
    normals = torch.nn.functional.normalize(torch.randn(200, 3, generator=generator), dim=1)
    normals = torch.cat([normals, torch.tensor([[0.0, 0, 1], [0, 0, -1], [1e-5, 0, -1]])])
    torch.testing.assert_close(quats_to_matrices(facing(normals))[:, :, 2], normals, atol=2e-4, rtol=0)
