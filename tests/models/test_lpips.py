import pytest
import torch
from torch.nn.functional import avg_pool2d, conv2d, pad

from tests.models.networks import outputs, random_weights
from tests.real_data import real_data
from tests.refusals import refused
from texgs.core.errors import ShapeError
from texgs.models.lpips import LAYERS, Lpips


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("lpips")
    torch.save(random_weights(), folder / "vgg.pth")
    generator = torch.Generator().manual_seed(5)
    widths = (64, 128, 256, 512, 512)
    heads = {
        f"lin{i}.model.1.weight": torch.rand(1, n, 1, 1, generator=generator) for i, n in enumerate(widths)
    }
    torch.save(heads, folder / "heads.pth")
    return folder, heads


def defined(image, other, heads):
    """The published formula in float64: inputs in [-1, 1] with its own shift and scale."""
    shift, scale = (torch.tensor(x)[:, None, None] for x in ([-0.03, -0.088, -0.188], [0.458, 0.448, 0.45]))
    both = torch.stack([(2 * x.permute(2, 0, 1) - 1 - shift) / scale for x in (image, other)])
    total = 0.0
    for taps, head in zip(outputs(both, (3, 8, 15, 22, 29)), heads.values(), strict=True):
        a, b = taps / (taps.square().sum(1, keepdim=True).sqrt() + 1e-10)
        total += float(conv2d((a - b).square()[None], head.double()).mean().detach())
    return total


def test_the_distance_is_the_published_one(files):
    folder, heads = files
    image, other = torch.rand(2, 32, 40, 3, generator=torch.Generator().manual_seed(1))
    lpips = Lpips.load(folder / "vgg.pth", folder / "heads.pth")
    assert float(lpips.distance(image, other)) == pytest.approx(defined(image, other, heads), rel=1e-4)
    assert float(lpips.distance(image, image)) == 0
    fastest = Lpips.load(folder / "vgg.pth", folder / "heads.pth", dtype=None)
    assert fastest.vgg.dtype == torch.float32  # on a CPU, also where that multiplies bfloat16 itself
    refused(lambda: lpips.distance(image, other[:20]), "other: ", ShapeError)
    refused(lambda: lpips.distance(image[..., 0], other[..., 0]), "image: ", ShapeError)


@pytest.mark.parametrize(
    ("rows", "columns"), [((20, 26), (30, 41)), ((0, 3), (100, 101)), ((89, 90), (0, 1)), ((0, 90), (0, 101))]
)
def test_an_image_that_differs_in_a_part_has_the_same_distance(files, rows, columns):
    """The oracle runs VGG on the whole image; sizes are odd, and parts reach the borders."""
    folder, _ = files
    lpips = Lpips.load(folder / "vgg.pth", folder / "heads.pth")
    generator = torch.Generator().manual_seed(2)
    image, noise = torch.rand(2, 90, 101, 3, generator=generator)
    where = torch.zeros(90, 101, dtype=torch.bool)
    where[slice(*rows), slice(*columns)] = True
    other = torch.where(where[..., None], noise, image)
    layers = dict(zip(LAYERS, lpips.vgg.layers(image.permute(2, 0, 1)[None]), strict=True))
    expected = float(lpips.distance(image, other))
    assert lpips.changed(layers, other, where) == pytest.approx(expected, rel=1e-4)
    assert lpips.changed(layers, image, where) == pytest.approx(0, abs=1e-4 * expected)


def test_heads_of_another_backbone_are_refused(files, tmp_path):
    folder, heads = files
    torch.save({**heads, "lin1.model.1.weight": torch.ones(1, 192, 1, 1)}, tmp_path / "alex.pth")
    refused(lambda: Lpips.load(folder / "vgg.pth", tmp_path / "alex.pth"), r"alex\.pth: lin1", ShapeError)


def test_real_weights_find_a_blur_worse_than_a_shade(monkeypatch):
    """What LPIPS is for: a blur and a faint change of brightness that the mean squared error calls equal."""
    monkeypatch.setenv("TEXGS_WEIGHTS", str(real_data("weights")))
    lpips = Lpips.load()
    generator = torch.Generator().manual_seed(0)
    image = 0.25 + 0.5 * torch.rand(16, 16, 3, generator=generator)
    image = image.repeat_interleave(4, 0).repeat_interleave(4, 1)
    padded = pad(image.permute(2, 0, 1)[None], (2, 2, 2, 2), mode="reflect")
    blurred = avg_pool2d(padded, 5, 1)[0].permute(1, 2, 0)
    shade = (blurred - image).square().mean().sqrt()
    assert float(lpips.distance(image, blurred)) > 2 * float(lpips.distance(image, image + shade))
