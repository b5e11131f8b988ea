import numpy as np
import pytest
import torch
from PIL import Image

from tests.refusals import refused
from texgs.core.errors import ShapeError
from texgs.core.image import read_rgba, to_pillow, write_png


@pytest.mark.parametrize(
    ("colors", "alphas", "pixels"),
    [
        ([[0.0, 0.5, 1.0], [-0.2, 1.7, 0.501]], None, [(0, 128, 255), (0, 255, 128)]),
        ([[0.25, 0.5, 0.0], [0.0, 0.0, 0.0]], [[0.5, 0.0]], [(128, 255, 0, 128), (0, 0, 0, 0)]),
    ],
)
def test_values_are_rounded_and_clamped_and_of_straight_alpha(tmp_path, colors, alphas, pixels):
    write_png(tmp_path / "x.png", torch.tensor([colors]), None if alphas is None else torch.tensor(alphas))
    with Image.open(tmp_path / "x.png") as picture:
        assert picture.mode == ("RGB" if alphas is None else "RGBA")
        assert [picture.getpixel((x, 0)) for x in range(2)] == pixels


def test_round_trip_is_within_rounding(tmp_path):
    generator = torch.Generator().manual_seed(0)
    alpha = torch.rand(9, 7, generator=generator)
    color = torch.rand(9, 7, 3, generator=generator) * alpha[..., None]
    write_png(tmp_path / "x.png", color, alpha)
    straight = torch.from_numpy(read_rgba(tmp_path / "x.png")) / 255
    color_read, alpha_read = straight[..., :3] * straight[..., 3:], straight[..., 3]
    # Half a level of the straight colour and half a level of alpha.
    torch.testing.assert_close(color_read, color, atol=1.01 / 255, rtol=0)
    torch.testing.assert_close(alpha_read, alpha, atol=0.51 / 255, rtol=0)


def test_grey_of_16_bits_is_rounded(tmp_path):
    Image.fromarray(np.array([[0, 257 * 100, 65535]], dtype=np.uint16)).save(tmp_path / "x.png")
    assert read_rgba(tmp_path / "x.png")[0].tolist() == [[0, 0, 0, 255], [100, 100, 100, 255], [255] * 4]


def test_one_channel_is_grey():
    assert to_pillow(torch.ones(2, 2, 1)).mode == "L"
    assert to_pillow(torch.ones(2, 2, 1), torch.ones(2, 2)).mode == "RGBA"


def test_mistakes_are_named(tmp_path):
    refused(lambda: to_pillow(torch.zeros(3, 2, 2)), "color: ", ShapeError)
    refused(lambda: to_pillow(torch.zeros(2, 2, 3), torch.zeros(2, 3)), "alpha: ", ShapeError)
    refused(lambda: to_pillow(torch.full((1, 1, 3), float("nan"))), "color: .*finite")
    refused(lambda: read_rgba(tmp_path / "none.png"), "no such file")
