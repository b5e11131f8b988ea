"""What views are compared with pictures by, and the place of the one that a look follows."""

from math import sqrt

import pytest
import torch

from tests.metrics.test_edit_metrics import MISSING, scenes, subject  # noqa: F401
from tests.models.networks import random_weights
from tests.real_data import real_data
from texgs.metrics.edits import retrieval
from texgs.metrics.retrieval import LAYERS, LUMINANCE, Likeness, contrast, likeness, style_likeness
from texgs.models.pictures import PICTURES, picture
from texgs.models.vgg import Vgg
from tools.style_likeness import picture_likeness


@pytest.fixture(scope="module")
def deep(tmp_path_factory):
    """A VGG with random weights of all layers that count."""
    path = tmp_path_factory.mktemp("deep") / "vgg.pth"
    torch.save(random_weights(), path)
    return Vgg.load(path, layers=LAYERS, dtype=torch.float32)


def everywhere(image):
    return torch.ones(image.shape[1:], dtype=torch.bool)


def test_shipped_descriptions_are_those_of_the_pictures():
    vgg = Vgg.load(real_data("weights/vgg16_features_fp16.safetensors"), layers=LAYERS, dtype=torch.float32)
    shipped = style_likeness()
    assert len(shipped.colors) == len(PICTURES) == 24
    for index in (0, 11, 23):
        now = picture_likeness(picture(PICTURES[index]), vgg)
        for name, x in vars(now).items():
            torch.testing.assert_close(getattr(shipped, name)[index], x, atol=2e-2, rtol=5e-3)


def test_each_picture_is_nearest_to_itself():
    pictures = style_likeness()
    for index in range(len(PICTURES)):
        own = Likeness(*(x[index, 0] for x in vars(pictures).values()))
        for far in own.distances(pictures).values():
            assert far.argmin() == index
            assert far[index] < 1e-3 < far.sort().values[1]


def test_distances_are_cosines_by_layer_and_the_hellinger_distance_of_histograms():
    """Two layers with one feature each: mean and deviation."""
    ours, other = (
        Likeness(*map(torch.tensor, lists))
        for lists in (
            ([1.0, 0, 0, 1], [1.0, 0, 3, 4], [0.25, 0.75]),
            ([0.0, 2, 0, 2], [2.0, 0, 4, 3], [1.0, 0.0]),
        )
    )
    far = ours.distances(Likeness(*(x[None, None] for x in vars(other).values())))
    shares = sqrt((0.5 - 1) ** 2 + 0.75)
    torch.testing.assert_close(far["colors"], torch.tensor([1 + 0 + 0.5 * shares]))
    torch.testing.assert_close(far["pattern"], torch.tensor([0 + 1 - 24 / 25]))


def test_contrast_is_one_around_every_pixel_of_the_object():
    """A brute-force Gaussian in float64 at one pixel; brightness and contrast of the image do not count."""
    generator = torch.Generator().manual_seed(0)
    image = torch.rand(3, 40, 48, generator=generator)
    where = torch.rand(40, 48, generator=generator) > 0.2
    shown = contrast(image, where)
    row, column, sigma = 20, 22, 48 / 16
    y, x = torch.meshgrid(torch.arange(40), torch.arange(48), indexing="ij")
    weight = (-((y - row) ** 2 + (x - column) ** 2) / (2 * sigma**2)).double().exp() * where
    weight[(y - row).abs().maximum((x - column).abs()) > 9] = 0
    grey = torch.einsum("chw,c->hw", image.double(), torch.tensor(LUMINANCE, dtype=torch.double))
    mean = (weight * grey).sum() / weight.sum()
    deviation = ((weight * grey**2).sum() / weight.sum() - mean**2).sqrt()
    wanted = 0.5 + 0.2 * (grey[row, column] - mean) / (deviation + 0.02) if where[row, column] else 0.5
    assert shown[0, row, column] == pytest.approx(float(wanted), abs=1e-4)
    assert (shown[:, ~where] == 0.5).all()
    torch.testing.assert_close(contrast(0.3 + 0.5 * image, where), shown, atol=0.05, rtol=0)


def test_only_the_object_is_described(deep):
    generator = torch.Generator().manual_seed(1)
    image, noise = (torch.rand(3, 64, 64, generator=generator) for _ in range(2))
    where = torch.zeros(64, 64, dtype=torch.bool)
    where[:, :40] = True
    ours, theirs = (likeness(x, where, deep) for x in (image, torch.where(where, image, noise)))
    for name in vars(ours):
        assert torch.equal(getattr(ours, name), getattr(theirs, name)), name
    red_and_blue = torch.zeros(3, 64, 64)
    red_and_blue[0, :16], red_and_blue[2, 16:] = 1, 1
    shares = likeness(red_and_blue, everywhere(red_and_blue), deep).histogram
    assert shares[5 * 36].item() == pytest.approx(0.25)
    assert shares[5].item() == pytest.approx(0.75)


def look(follows, **far):
    return follows, {"far_by_colors": far, "far_by_pattern": {name: -x for name, x in far.items()}}


def test_a_picture_that_is_near_to_all_looks_is_no_answer():
    """`hub` is the nearest of both; less its mean each look is nearest to its own."""
    looks = [look("glass", glass=3.0, dots=5.0, hub=1.0), look("dots", glass=4.0, dots=4.0, hub=1.0)]
    assert retrieval.places_among(looks) == [{"place_by_colors": 1, "place_by_pattern": 3}] * 2
    third = look("mine.jpg", glass=1.0, dots=1.0, hub=1.0)
    without = ("gold", {})
    places = retrieval.places_among([*looks, third, without])
    assert places[2:] == [{}, {}]
    assert places[0].keys() == places[1].keys() == {"place_by_colors", "place_by_pattern"}
    assert retrieval.places_among([*looks, look("glass", other=1.0)])[2] == {}, "compared with other pictures"
    assert retrieval.places_among(looks[:1]) == [{}]
    assert retrieval.places_among([]) == []


def test_an_edited_scene_tells_its_distances_to_all_pictures(scenes, deep, monkeypatch):  # noqa: F811
    monkeypatch.setattr("texgs.metrics.metric.MeasuredScene.vgg", deep)
    given = [scenes["clear"]] * 3
    measured = retrieval.run(subject(*given, weights={**MISSING, "vgg16": "here"}))
    assert measured.keys() == {"far_by_colors", "far_by_pattern"}
    assert list(measured["far_by_colors"]) == list(PICTURES)
    assert all(0 < x < 5 for far in measured.values() for x in far.values())
    monkeypatch.undo()
    assert retrieval.run(subject(*given, weights=MISSING)) == {}


def test_looks_that_are_alike_have_the_last_place():
    """A method that did the same for every picture would else be the best of all."""
    far = {"far_by_colors": dict.fromkeys("abc", 1.5)}
    assert retrieval.places_among([(picture, far) for picture in "abc"]) == [{"place_by_colors": 3}] * 3
