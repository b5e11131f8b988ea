from contextlib import suppress

import pytest
import torch

from tests.raster.requirements import require_equal, require_same_bits
from tests.refusals import refused
from texgs.core.camera import Camera, look_at, orbit
from texgs.core.errors import FitError
from texgs.core.image import write_png
from texgs.fields.surfels.shading import raw_material
from texgs.fitting import checkpoint
from texgs.fitting.checkpoint import CHECK_INTERVAL
from texgs.fitting.loop import extent
from texgs.fitting.seeds import seed_surfels
from texgs.fitting.settings import Densify, Losses, Rates, Seeds
from texgs.raster.shading import MATERIAL
from texgs.volume.images import load
from texgs.volume.view_set import View, ViewSet, read_views, write_transforms

from .scenes import (
    HEADLIGHT,
    ball_images,
    ball_planes,
    ball_seeds,
    cameras,
    images_of,
    is_finite,
    model_of,
    new_fit,
    quality,
    run,
)  # fmt: skip

SIZE = 32
DENSIFY = Densify(start=20, stop=120, every=20, cap=150)  # no resets, after which images are pale


def flat_images(color, alpha, count=4, views=None):
    """Images of one colour over white and one alpha."""
    views = views or cameras(count)
    planes = torch.cat([torch.tensor(color), torch.tensor([alpha])])[:, None, None].expand(4, SIZE, SIZE)
    return images_of([planes] * len(views), views)


def test_it_fits_a_ball():
    fit = run(new_fit(iterations=200, densify=DENSIFY))
    assert quality(model_of(new_fit()), fit.images) < 16
    assert quality(model_of(fit), fit.images) > 21
    assert 80 < len(fit.parameters["means"]) <= 150


def test_the_same_seed_is_bit_equal_and_another_one_differs():
    first, same, other = (run(new_fit(seed=seed)).state() for seed in (0, 0, 1))
    require_equal(same, first)
    assert not all(torch.equal(x, other[name]) for name, x in first.items())


def test_threads_do_not_change_the_result():
    require_same_bits(lambda: run(new_fit(), 26).state(), threads=(2,))  # past a split and a reset


def test_every_epoch_shows_every_view_once_in_its_own_order():
    fit = new_fit(images=ball_images(count=7))
    epochs = [[fit.view_of(7 * epoch + place + 1) for place in range(7)] for epoch in range(6)]
    assert all(sorted(epoch) == list(range(7)) for epoch in epochs)
    assert len(set(map(tuple, epochs))) == 6
    other = new_fit(seed=1, images=fit.images)
    assert epochs != [[other.view_of(7 * e + p + 1) for p in range(7)] for e in range(6)]
    draws = [torch.rand(4, generator=fit.generator(stream)).tolist() for stream in range(50)]
    assert len(set(map(tuple, draws))) == 50, "orders and splits have random numbers of their own"


def test_a_rate_of_zero_keeps_a_parameter():
    rates = Rates(means=0.0, material=0.0)
    fit = run(new_fit(rates=rates, densify=Densify(stop=0), iterations=5))
    start = ball_seeds()
    for name, x in fit.parameters.items():
        assert torch.equal(x, start[name]) == (name in ("means", *MATERIAL)), name


def test_progress_is_told_after_every_iteration():
    fit, losses = new_fit(iterations=CHECK_INTERVAL + 5, densify=Densify(stop=0)), {}
    for iteration, done in enumerate(fit.run(), 1):
        assert iteration == done
        losses.setdefault(len(fit.losses), done)
    assert losses == {0: 1, 1: CHECK_INTERVAL, 2: CHECK_INTERVAL + 5}


def test_the_extent_is_that_of_the_cameras_or_four_times_that_of_the_surfels():
    views = [orbit(azimuth, 0, 2.0, 50, SIZE, SIZE) for azimuth in (0, 90, 180, 270)]
    means = torch.tensor([[0.5, 0.0, 0.0], [-0.5, 0.0, 0.0]])
    assert extent(flat_images([1.0] * 3, 1.0, views=views).cameras, means) == pytest.approx(2.2)
    one = flat_images([1.0] * 3, 1.0, views=views[:1])
    assert extent(one.cameras, means) == pytest.approx(2.2)
    assert extent(one.cameras, means[:0]) > 0


def test_one_view_is_enough():
    fit = run(new_fit(images=ball_images(count=1), iterations=150, densify=DENSIFY))
    assert is_finite(fit.parameters)
    assert quality(model_of(fit), fit.images) > 20


@pytest.mark.parametrize(
    ("color", "alpha"), [(1.0, 0.0), (1.0, 1.0), (0.0, 1.0)], ids=["empty", "white", "black"]
)
@pytest.mark.parametrize("losses", [Losses(), Losses(normal=0.05), Losses(dssim=1.0), Losses(0.0, 1.0)])
def test_images_of_one_colour_give_a_finite_model(color, alpha, losses):
    iterations = 120 if losses == Losses() else 30
    images = flat_images([color] * 3, alpha)
    fit = run(new_fit(images=images, losses=losses, iterations=iterations))
    assert is_finite(fit.state())
    if color == 1 and iterations == 120:
        assert quality(model_of(fit), images) > 25


def test_a_fit_that_has_lost_all_of_its_surfels_stops_and_says_so():
    images = flat_images([1.0, 1.0, 1.0], 0.0)
    start = ball_seeds(opacity=0.006)
    densify = Densify(start=0, stop=40, every=10, threshold=10.0, prune_opacity=0.5)
    fit = new_fit(images=images, parameters=start, iterations=60, densify=densify)
    refused(lambda: run(fit), r"iteration 10: .* pruned; .*densify\.prune_opacity", FitError)


def seeded(images, view_set, count):
    """A fit of surfels that start where views say."""
    parameters, colors = seed_surfels(images, view_set, Seeds(count=count, half_size=1.1), 0)
    start = {**parameters, "colors": colors, **raw_material(0.5, 0.5, 0.1, 20, "bounded")}
    return run(new_fit(images=images, parameters=start, iterations=150, densify=DENSIFY))


def test_views_without_alpha_fit_from_files(tmp_path):
    views = []
    for index, camera in enumerate(cameras(4)):
        path = write_png(tmp_path / f"r_{index}.png", ball_planes(camera)[:3].permute(1, 2, 0))
        views.append(View(camera, path, HEADLIGHT))
    write_transforms(tmp_path, "train", views, {"aabb": [[-0.4] * 3, [0.4] * 3]})
    view_set = read_views(tmp_path)
    fit = seeded(load(view_set.train), view_set, 80)
    assert is_finite(fit.state())
    assert quality(model_of(fit), fit.images) > 18


def test_cameras_inside_of_the_object_fit(tmp_path):
    K = torch.tensor([[20.0, 0, 16], [0, 20, 16], [0, 0, 1]])
    targets = torch.tensor([[1.0, 0, 0], [0, 0, 1.0], [-1.0, 0, 0.1], [0.1, 0, -1.0]])
    views = [Camera(look_at(0.02 * t, t), K, SIZE, SIZE) for t in targets]
    fit = seeded(flat_images([0.2, 0.5, 0.9], 1.0, views=views), ViewSet(tmp_path, [], [], {}), 150)
    assert is_finite(fit.state())
    assert quality(model_of(fit), fit.images) > 12


def test_a_material_for_each_surfel_stays_finite_and_smooth():
    seeds = ball_seeds()
    seeds |= {name: seeds[name].repeat(80) for name in MATERIAL}
    fit = run(new_fit(parameters=seeds, losses=Losses(smoothness=0.01)))
    assert is_finite(fit.state())
    assert len(fit.parameters["ambient"]) == len(fit.parameters["means"]) > 80


def test_a_loss_that_is_not_finite_ends_the_run_and_keeps_the_checkpoint(tmp_path):
    fit = run(new_fit(iterations=CHECK_INTERVAL, densify=Densify(stop=0)), 20)
    checkpoint.save(tmp_path, fit)
    with torch.no_grad():
        fit.parameters["colors"].fill_(torch.nan)
    refused(lambda: run(fit), "iteration 100: means: .*240 NaN", FitError)
    state = checkpoint.latest(tmp_path)
    assert int(state["iteration"]) == 20
    assert is_finite(state)


def test_rates_that_are_far_too_high_end_in_an_error_or_a_finite_model():
    rates = Rates(means=1e6, scales=50.0, quats=1e3, colors=1e4)
    fit = new_fit(rates=rates, iterations=CHECK_INTERVAL, densify=Densify(stop=0))
    with suppress(FitError):
        assert is_finite(run(fit).state())
