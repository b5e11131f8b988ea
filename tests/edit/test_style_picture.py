import numpy as np
import pytest
import torch
from PIL import Image

from tests.refusals import refused
from texgs.core.errors import OutOfMemoryError, ShapeError
from texgs.edit.style_picture import StylePicture, fill_outside, mirrored_crop, read_style
from texgs.models.pictures import PICTURES, picture


def pixels(height, width, channels=3, seed=0):
    return np.random.default_rng(seed).integers(0, 256, (height, width, channels), dtype=np.uint8)


@pytest.fixture
def read(tmp_path):
    """Write pixels to a file and read it as a style."""

    def write_and_read(values, find=None, name="x.png", **options):
        Image.fromarray(values).save(tmp_path / name, **options)
        return read_style(tmp_path / name, find)

    return write_and_read


@pytest.mark.parametrize("ending", ["png", "jpg"])
def test_a_picture_keeps_its_size_and_aspect(read, ending):
    style = read(np.full((60, 90, 3), (200, 100, 50), np.uint8), name=f"x.{ending}")
    assert style.image.shape == (3, 60, 90)
    assert style.region.all()
    torch.testing.assert_close(style.mean, torch.tensor([200, 100, 50]) / 255, atol=0.02, rtol=0)
    assert style.scaled(30).image.shape == (3, 20, 30)
    assert style.scaled(180).image.shape == (3, 120, 180)


@pytest.mark.parametrize("mode", ["LA", "P", "I;16", "1", "CMYK"])
def test_any_kind_of_pixels_becomes_red_green_and_blue(tmp_path, mode):
    picture = Image.fromarray(pixels(40, 50)).convert("L" if mode == "I;16" else mode)
    if mode == "I;16":
        picture = Image.fromarray(np.asarray(picture).astype(np.uint16) * 257)
    name = "x.tif" if mode in ("I;16", "CMYK") else "x.png"
    picture.save(tmp_path / name)
    style = read_style(tmp_path / name)
    assert style.image.shape == (3, 40, 50)
    assert 0 <= style.image.min() < 0.2 < 0.8 < style.image.max() <= 1


def test_what_is_transparent_does_not_count(read):
    values = pixels(64, 64, 4)
    values[..., 3] = 0
    values[10:50, 20:60] = (10, 200, 30, 255)
    expected = (torch.tensor([10, 200, 30]) / 255)[:, None, None].expand(3, 40, 40)
    torch.testing.assert_close(read(values).image, expected)


def test_a_region_is_cut_out_and_what_is_around_it_filled(read):
    values = np.full((80, 80, 3), 255, np.uint8)
    y, x = np.mgrid[:80, :80]
    disc = (x - 40) ** 2 + (y - 40) ** 2 < 24**2
    values[disc] = (0, 0, 128)
    style = read(values, lambda _: torch.from_numpy(disc))
    assert style.image.shape == (3, 47, 47)
    assert not style.region.all()
    assert style.image.max() <= 128 / 255 + 1e-6, "white around it has gone"
    small, none = torch.from_numpy(disc[:70]), torch.zeros(80, 80, dtype=torch.bool)
    refused(lambda: read(values, lambda _: small), r"region: expected \[80, 80\]", ShapeError)
    refused(lambda: read(values, lambda _: none), r"x\.png: region: expected a part of the style")


def test_filling_takes_the_nearest_colour():
    image = torch.zeros(3, 3, 4)
    image[:, :, 0], image[:, :, 3] = 0.2, 0.8
    region = torch.zeros(3, 4, dtype=torch.bool)
    region[:, 0] = region[:, 3] = True
    expected = torch.tensor([0.2, 0.2, 0.8, 0.8]).expand(3, 3, 4)
    assert torch.equal(fill_outside(image, region), expected)


def test_a_large_picture_is_reduced(tmp_path):
    Image.new("L", (2500, 5000), 90).save(tmp_path / "large.png")
    assert read_style(tmp_path / "large.png").image.shape == (3, 2048, 1024)
    Image.new("RGB", (9000, 40)).save(tmp_path / "narrow.png")
    assert read_style(tmp_path / "narrow.png").image.shape == (3, 32, 7200), "wide enough to hold a pattern"


def test_what_is_no_picture_is_named(tmp_path):
    (tmp_path / "text.png").write_text("no picture")
    Image.fromarray(pixels(64, 64)).save(tmp_path / "whole.png")
    (tmp_path / "cut.png").write_bytes((tmp_path / "whole.png").read_bytes()[:4000])
    Image.new("RGB", (10, 10)).save(tmp_path / "tiny.png")
    for name, named in {
        **dict.fromkeys(("text", "cut"), "expected a picture, got"),
        "tiny": ".*at least 32 x 32 pixels, got 10 x 10;",
        "gone": "no such file",
    }.items():
        refused(lambda name=name: read_style(tmp_path / f"{name}.png"), rf"{name}\.png: {named}")


def test_a_crop_is_one_of_the_mirrored_plane():
    image = torch.rand(3, 5, 4)
    plane = torch.from_numpy(np.pad(image.numpy(), ((0, 0), (0, 30), (0, 30)), mode="symmetric"))
    assert torch.equal(mirrored_crop(image, 7, 3, 12, 20), plane[:, 7:19, 3:23])


def test_a_pattern_larger_than_memory_is_refused():
    style = StylePicture.of(torch.rand(3, 40, 40))
    refused(lambda: style.scaled(1e6), "1000000 x 1000000 pixels: .* edit.image.pattern", OutOfMemoryError)


def test_a_vivid_style_has_its_greys_and_twice_its_differences_from_them():
    image = torch.full((3, 40, 40), 0.5)
    image[:, :, 20:] = torch.tensor([0.2, 0.3, 0.7])[:, None, None]
    vivid = StylePicture.of(image).vivid(2.0).image
    assert torch.equal(vivid[:, :, :20], image[:, :, :20])
    torch.testing.assert_close(vivid[:, 0, 30], torch.tensor([0.0, 0.2, 1.0]))


def test_a_photograph_is_turned_upright(read):
    values = np.zeros((40, 60, 3), np.uint8)
    values[:, :30] = (255, 0, 0)  # left as stored; the camera was held upright
    exif = Image.Exif()
    exif[0x0112] = 6  # stored turned by 90 degrees to the left
    style = read(values, name="x.jpg", exif=exif, quality=95)
    assert style.image.shape == (3, 60, 40)
    assert style.image[0, :28].min() > 0.9
    assert style.image[0, 32:].max() < 0.1


def test_a_part_is_sought_in_the_whole_picture(read):
    """Not in the box around what is visible: clicks are shares of the file."""
    values = pixels(64, 96, 4)
    values[..., 3] = 255
    values[:, :48, 3] = 0
    seen = []

    def find(image):
        seen.append(image.shape)
        return torch.ones(image.shape[:2], dtype=torch.bool)

    assert read(values, find).image.shape == (3, 64, 48)
    assert seen == [(64, 96, 3)]


@pytest.mark.parametrize("name", PICTURES)
def test_a_picture_is_colours_with_contrast_at_any_size(name):
    image, small = picture(name), picture(name, 96)
    assert image.shape == (3, 512, 512)
    assert small.shape == (3, 96, 96)
    assert 0 <= image.min() <= image.max() <= 1
    assert small.std(dim=(1, 2)).min() > 0.05
    assert (small.mean(dim=(1, 2)) - image.mean(dim=(1, 2))).abs().max() < 0.01


def test_pictures_differ_and_a_name_that_is_unknown_is_answered_with_those_known():
    means = torch.stack([picture(name).mean(dim=(1, 2)) for name in PICTURES])
    assert torch.pdist(means).min() > 0.02
    refused(lambda: picture("sketch"), r"expected one of strokes, glass, .*, got 'sketch'")
