"""Metrics that watch views: VGG-16 runs once a view; all views make what the definitions say."""

import gc
from dataclasses import replace
from math import sqrt
from statistics import fmean
from weakref import ref

import pytest
import torch

from tests.fields.surfels.test_composition import ball
from tests.metrics.test_edit_metrics import CAMERAS, MISSING, scenes, subject  # noqa: F401
from tests.metrics.test_style import rows
from tests.models.test_lpips import files  # noqa: F401
from texgs.fields.surfels.model_file import write_model
from texgs.metrics.consistency import LONG_RANGE, SHORT_RANGE, SeenFrame, difference
from texgs.metrics.edits import consistency, style, views
from texgs.metrics.metric import Style, metrics, values_of
from texgs.metrics.style import StyleTarget
from texgs.models import lpips
from texgs.models.vgg import Vgg
from texgs.scene.scene import SceneModel
from texgs.scene.scene_file import read_scene, write_scene

WEIGHTS = {**MISSING, "vgg16": "here", "lpips_vgg": "here"}
PICTURE = torch.rand(3, 24, 32, generator=torch.Generator().manual_seed(3))
REGION = torch.ones(24, 32, dtype=torch.bool)


@pytest.fixture
def weights(files, monkeypatch):  # noqa: F811
    """Random weights where all look for them."""
    folder = files[0]
    monkeypatch.setattr("texgs.models.vgg.locate", lambda name: folder / "vgg.pth")
    monkeypatch.setattr("texgs.models.lpips.locate", lambda name: folder / "heads.pth")


@pytest.fixture
def given(scenes, weights):  # noqa: F811
    """A ball that follows a picture."""
    styles = [Style(None, PICTURE, REGION)]
    return subject(*[scenes["clear"]] * 3, compared=12, weights=WEIGHTS, styles=styles)


def seen(given):
    """All frames of the path, with the geometry's depth."""
    for camera in CAMERAS:
        shown = given.shown.render(camera, given.after.light)
        surface = given.shown.render(camera, outputs=("median",))
        yield SeenFrame(shown.color.clamp(0, 1), surface.median, surface.alpha, camera)


def test_all_views_make_the_means_over_all_pairs_and_views(given, monkeypatch):
    """The oracle runs VGG on whole images, each time anew."""
    monkeypatch.setattr(style, "QUERIES", None)
    measured, frames, network = values_of(given), list(seen(given)), lpips.Lpips.load()
    for name, apart in (("short", SHORT_RANGE), ("long", LONG_RANGE)):
        found = []
        for first, second in zip(frames, frames[apart:], strict=False):
            distance = lambda image, where, first=first: float(network.distance(first.image, image))  # noqa: E731
            found.append(difference(first, second, distance))
        found = [pair for pair in found if pair]
        assert len(found) > 3
        rmse = sqrt(fmean(pair.square for pair in found))
        assert measured[f"{name}_rmse"] == pytest.approx(rmse, rel=1e-6)
        assert measured[f"{name}_lpips"] == pytest.approx(fmean(pair.distance for pair in found), rel=1e-4)
    vgg = Vgg.load(dtype=torch.float32)
    target = StyleTarget.of(rows(vgg, PICTURE))
    each = [rows(vgg, frame.image.permute(2, 0, 1), frame.alpha) for frame in frames]
    nnfm, gram = map(fmean, zip(*(target.distances(some) for some in each if len(some)), strict=True))
    assert measured["style_nnfm"] == pytest.approx(nnfm, rel=1e-4)
    assert measured["style_gram"] == pytest.approx(gram, rel=1e-4)


def test_the_networks_go_with_the_measured_scene(given):
    """VGG-16 holds 280 MB with its Winograd weights; cycles would keep them until Python looks for cycles."""
    gc.collect()
    gc.disable()
    try:
        values_of(given)
        network = ref(given.vgg)
        del given.__dict__["vgg"]
        assert network() is None
        frames = ref(given.frame)
        del given.__dict__["frame"]
        assert frames() is None
    finally:
        gc.enable()


@pytest.mark.parametrize("count", [1, 4, 12, 99])
def test_vgg_runs_once_a_view_and_once_a_picture(given, monkeypatch, count):
    images = []
    layers = Vgg.layers
    monkeypatch.setattr(Vgg, "layers", lambda vgg, x, *more: images.append(x) or layers(vgg, x, *more))
    others = [metric for metric in metrics().values() if metric.name != "retrieval"]  # has views of its own
    values_of(replace(given, compared=count), others)
    assert len(images) == min(count, 12) + 1
    assert len({image.numpy().tobytes() for image in images}) == len(images)


def test_no_frame_is_rendered_twice(given, monkeypatch):
    rendered = []
    render = type(given.shown).render

    def watched(scene, camera, *more, outputs=(), **options):
        rendered.append((scene is given.shown, CAMERAS.index(camera)))
        return render(scene, camera, *more, outputs=outputs, **options)

    monkeypatch.setattr(type(given.shown), "render", watched)
    values_of(given, [consistency.METRIC, style.METRIC])
    assert len(rendered) == len(set(rendered)) == 2 * len(CAMERAS)


@pytest.mark.parametrize(
    ("count", "places", "told"),
    [(4, [1, 4, 7, 10], "2, 5, 8, 11 of 12"), (1, [6], "7 of 12"), (12, [*range(12)], "all of 12")],
)
def test_views_are_the_middles_of_equal_parts_and_are_told(given, count, places, told):
    some = replace(given, compared=count)
    assert some.places == places
    assert some.some == [CAMERAS[place] for place in places]
    assert values_of(some, [views.METRIC]) == {"views": told}


def test_a_picture_that_one_model_follows_is_compared_with_it_alone(scenes, given, tmp_path):  # noqa: F811
    write_model(tmp_path / "other.safetensors", ball(2, middle=0.3))
    alone = read_scene(scenes["clear"])
    both = {**alone.models, "other": SceneModel(tmp_path / "other.safetensors")}
    write_scene(tmp_path / "both.yaml", replace(alone, models=both))
    whole = subject(*[tmp_path / "both.yaml"] * 3, compared=12, weights=WEIGHTS, styles=given.styles)
    one = replace(whole, styles=[Style("ball", PICTURE, REGION)])
    expected, of_one, of_all = (values_of(each, [style.METRIC]) for each in (given, one, whole))
    assert of_one == pytest.approx(expected, rel=1e-5)
    assert of_all["style_gram"] != pytest.approx(expected["style_gram"], rel=1e-2)


def test_without_weights_views_are_compared_by_their_pixels_alone(given):
    measured = values_of(replace(given, weights=MISSING))
    assert {"short_rmse", "long_rmse", "geometry_kept"} <= measured.keys()
    assert {"style_nnfm", "style_gram"}.isdisjoint(measured)
    assert measured["short_lpips"] is None
