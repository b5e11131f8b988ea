from dataclasses import replace

import pytest
import torch
from PIL import Image

from tests.fitting.scenes import HEADLIGHT, cameras, images_of
from texgs.core.errors import ArgumentError, OutOfMemoryError
from texgs.volume.images import load, over_white, shrink, smaller
from texgs.volume.view_set import View


def random_view(folder, camera, seed=0, channels=4):
    """A view of random straight-alpha pixels, and these as floats [H, W, 4]."""
    generator = torch.Generator().manual_seed(seed)
    pixels = torch.randint(0, 256, (camera.height, camera.width, 4), generator=generator, dtype=torch.uint8)
    pixels[0, :2, 3] = torch.tensor([0, 255])
    path = folder / f"r_{seed}.png"
    Image.fromarray(pixels[..., :channels].numpy()).save(path)
    return View(camera, path, HEADLIGHT), pixels.double() / 255


def expected_planes(pixels):
    """Colour over white and alpha [4, H, W], float64."""
    color, alpha = pixels[..., :3], pixels[..., 3:]
    return torch.cat([color * alpha + 1 - alpha, alpha], dim=2).permute(2, 0, 1)


def test_images_are_kept_to_half_a_value_of_8_bits(tmp_path):
    pairs = [random_view(tmp_path, camera, seed) for seed, camera in enumerate(cameras(3, size=8))]
    images = load([view for view, _ in pairs])
    assert images.planes.dtype == torch.uint8
    assert len(images) == 3
    for index, (view, pixels) in enumerate(pairs):
        target = images.target(index)
        planes = torch.cat([target.color.permute(2, 0, 1), target.alpha[None]])
        assert (planes.double() - expected_planes(pixels)).abs().max() <= 0.5 / 255 + 1e-6
        assert torch.equal(target.camera.viewmat, view.camera.viewmat)
        torch.testing.assert_close(over_white(view).double(), expected_planes(pixels), atol=1e-6, rtol=0)


def test_8_bits_as_floats_and_back_are_the_same(tmp_path):
    camera = cameras(1, size=16)[0]
    gray = torch.arange(256, dtype=torch.uint8).reshape(16, 16)
    Image.fromarray(torch.stack([gray] * 3, dim=2).numpy()).save(tmp_path / "r_0.png")
    images = load([View(camera, tmp_path / "r_0.png", HEADLIGHT)])
    assert torch.equal(images.planes[0], torch.stack([gray, gray, gray, torch.full_like(gray, 255)]))
    target = images.target(0)
    assert torch.equal((target.color[..., 0] * 255).round().to(torch.uint8), gray)


@pytest.mark.parametrize("reduce", [2, 4])
def test_reducing_averages_premultiplied_colour(tmp_path, reduce):
    view, pixels = random_view(tmp_path, cameras(1, size=8)[0])
    n = 8 // reduce
    blocks = expected_planes(pixels).reshape(4, n, reduce, n, reduce)
    torch.testing.assert_close(over_white(view, reduce).double(), blocks.mean(dim=(2, 4)), atol=1e-6, rtol=0)
    assert load([view], reduce).planes.shape == (1, 4, n, n)


def test_a_reduced_camera_sees_points_at_the_same_place_of_the_image(tmp_path):
    camera = cameras(1, size=8)[0]
    half = smaller(camera, 2)
    assert (half.width, half.height) == (4, 4)
    point = torch.tensor([0.1, 0.2, 1.0])
    torch.testing.assert_close((half.K @ point)[:2] * 2, (camera.K @ point)[:2])
    assert half.K[2].tolist() == [0, 0, 1]


def test_images_without_alpha_are_opaque(tmp_path):
    view, pixels = random_view(tmp_path, cameras(1, size=8)[0], channels=3)
    target = load([view]).target(0)
    assert torch.equal(target.alpha, torch.ones(8, 8))
    torch.testing.assert_close(target.color.double(), pixels[..., :3], atol=1e-6, rtol=0)


def test_mistakes_are_named(tmp_path):
    view, _ = random_view(tmp_path, cameras(1, size=8)[0])
    large = replace(view, camera=replace(view.camera, width=1 << 20, height=1 << 20))
    for views, reduce, message in [
        ([view], 3, "reduce: expected a divisor of 8 x 8 pixels, got 3"),
        ([replace(view, path=tmp_path / "gone.png")], 1, r"gone\.png: no such file"),
        ([large], 1, "1 views of 1048576 x 1048576 pixels"),
    ]:
        with pytest.raises((ArgumentError, OutOfMemoryError), match=message):
            load(views, reduce)


def test_images_are_shrunk_by_averages_and_the_rest_is_cut():
    camera = cameras(1, size=11)[0]
    planes = torch.rand(4, 11, 11, generator=torch.Generator().manual_seed(0))
    images = images_of([planes], [camera])
    small = shrink(images, 2)
    blocks = images.planes[0, :, :10, :10].float().reshape(4, 5, 2, 5, 2).mean(dim=(2, 4))
    assert (small.planes[0].float() - blocks).abs().max() <= 0.5
    assert (small.cameras[0].width, small.cameras[0].height) == (5, 5)
    assert shrink(images, 0) is images
