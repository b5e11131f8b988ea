import pytest
import torch

from texgs.core.errors import ArgumentError
from texgs.edit.noise import fractal, palette, voronoi
from texgs.edit.pictures import PICTURES, picture


@pytest.fixture(scope="module")
def small():
    return {name: picture(name, 96) for name in PICTURES}


@pytest.mark.parametrize("name", PICTURES)
def test_a_picture_is_colours_with_contrast_and_always_the_same(small, name):
    image = small[name]
    assert image.shape == (3, 96, 96)
    assert 0 <= image.min() <= image.max() <= 1
    assert image.std(dim=(1, 2)).min() > 0.05
    assert torch.equal(image, picture(name, 96))


def test_pictures_differ(small):
    means = torch.stack([x.mean(dim=(1, 2)) for x in small.values()])
    assert torch.pdist(means).min() > 0.03


def test_a_name_that_is_unknown_is_answered_with_those_known():
    with pytest.raises(ArgumentError, match=r"expected one of strokes, glass, .*, got 'sketch'"):
        picture("sketch")


def test_patterns():
    assert abs(fractal(64, 4, seed=0).mean()) < 0.3
    nearest, second, cell = voronoi(64, 9, seed=0)
    assert (nearest <= second).all()
    assert set(cell.flatten().tolist()) <= set(range(9))
    colors = palette(["#000000", "#ff0000"], torch.tensor([[-1.0, 0.5, 2.0]]).numpy())
    assert colors.tolist() == [[[0, 0, 0], [0.5, 0, 0], [1, 0, 0]]]
