import torch

from tests.edit.lift_scenes import two_balls
from texgs.edit.pieces import pieces_at


def balls():
    """Two balls that do not touch, and which surfels are of the first."""
    model, number = two_balls()
    return model, number == 0


def test_only_the_piece_that_holds_the_place_is_kept():
    model, is_red = balls()
    both = torch.ones_like(is_red)
    middle = model.parameters["means"][is_red].mean(0, keepdim=True)
    assert torch.equal(pieces_at(model, both, middle), is_red)
    other = model.parameters["means"][~is_red].mean(0, keepdim=True)
    assert torch.equal(pieces_at(model, both, torch.cat([middle, other])), both)


def test_what_is_not_in_the_segment_connects_nothing():
    model, is_red = balls()
    x = model.parameters["means"][:, 0]
    red = x[is_red]
    ends = is_red & ((x < red.quantile(0.2)) | (x > red.quantile(0.8)))
    at = model.parameters["means"][is_red & (x == red.min())]
    assert torch.equal(pieces_at(model, ends, at), ends & (x < red.quantile(0.5)))


def test_a_single_surfel_is_a_piece():
    model, is_red = balls()
    one = torch.zeros_like(is_red)
    one[7] = True
    assert torch.equal(pieces_at(model, one, torch.zeros(1, 3)), one)
