"""Z curves against digits written out, and what they are for."""

import torch
from hypothesis import given
from hypothesis import strategies as st

from texgs.core.morton import z_order, z_order_of


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
    ordered = places[z_order_of(places)] / places.amax(0)
    assert (
        ordered.diff(dim=0).norm(dim=1).median()
        < 0.2 * (places / places.amax(0)).diff(dim=0).norm(dim=1).median()
    )


def test_places_in_a_plane_and_in_one_point_have_an_order():
    places = torch.tensor([[3.0, 1.0, 2.0], [0.0, 1.0, 0.0], [3.0, 1.0, 0.0]])
    assert z_order_of(places).tolist() == [1, 2, 0]
    assert z_order_of(places[:1].expand(3, 3)).tolist() == [0, 1, 2]
    assert z_order_of(places[:0]).tolist() == []
