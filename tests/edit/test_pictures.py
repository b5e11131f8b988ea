import pytest
import torch

from texgs.core.errors import ArgumentError
from texgs.edit.pictures import PICTURES, picture


@pytest.mark.parametrize("name", PICTURES)
def test_a_picture_is_colours_with_contrast_at_any_size(name):
    image, small = picture(name), picture(name, 96)
    assert image.shape == (3, 512, 512)
    assert small.shape == (3, 96, 96)
    assert 0 <= image.min() <= image.max() <= 1
    assert small.std(dim=(1, 2)).min() > 0.05
    assert (small.mean(dim=(1, 2)) - image.mean(dim=(1, 2))).abs().max() < 0.01


def test_pictures_differ():
    means = torch.stack([picture(name).mean(dim=(1, 2)) for name in PICTURES])
    assert torch.pdist(means).min() > 0.03


def test_a_name_that_is_unknown_is_answered_with_those_known():
    with pytest.raises(ArgumentError, match=r"expected one of strokes, glass, .*, got 'sketch'"):
        picture("sketch")
