import pytest
import torch

from tests.raster.requirements import require_equal
from texgs.fields.gaussians import Baked, Gaussians
from texgs.fields.splats import screen_box
from texgs.fitting import checkpoint
from texgs.fitting.gaussians import fit_gaussians, seed_gaussians
from texgs.fitting.loop import Fit
from texgs.fitting.settings import CommonRates, Densify, GaussianKeys, Seeds
from texgs.fitting.task import FitTask
from texgs.raster.shading import Y00
from texgs.volume.generate import sphere
from texgs.volume.view_set import ViewSet

from .scenes import SIZE, ball_images, is_finite, quality, run

SEEDS = Seeds(kind="hull", count=80, opacity=0.1, half_size=0.8)
DENSIFY = Densify(start=20, stop=120, every=20, cap=150)  # no resets, after which images are pale
HARMONICS = (1, 4, 9, 16)


def task_of(folder, **keys):
    """A fit of the ball that learns as fast as the quick recipe."""
    rates = CommonRates(quats=0.016, sh_rest=0.03)
    keys = {"iterations": 200, "sh_every": 20, "rates": rates, "densify": DENSIFY, "seeds": SEEDS, **keys}
    views = ViewSet(folder, [], [], {})
    return FitTask(GaussianKeys(**keys), views, ball_images(), folder, torch.device("cpu"), 0, "ball", {})


def test_it_fits_a_ball(tmp_path):
    task = task_of(tmp_path)
    fitted = fit_gaussians(task)
    seeds = fit_gaussians(task_of(tmp_path / "none", iterations=0)).field
    assert quality(seeds, task.images) < 19
    assert quality(fitted.field, task.images) > 24
    assert 80 < len(fitted.field) <= 150
    assert fitted.field.parameters["sh"].shape[1:] == (16, 3)
    assert (fitted.iterations, len(fitted.losses)) == (200, 2)
    assert is_finite(fitted.field.parameters)


@pytest.mark.parametrize(
    "keys", [{"antialiased": True}, {"alpha": 0.1}, {"sh_degree": 1}, {"dssim": 1.0}, {"sh_degree": 0}]
)
def test_keys_reach_the_fit(tmp_path, keys):
    field = fit_gaussians(task_of(tmp_path, iterations=40, sh_every=10, **keys)).field
    assert field.shading == Baked(keys.get("antialiased", False))
    assert field.parameters["sh"].shape[1] == HARMONICS[keys.get("sh_degree", 3)]
    plain = fit_gaussians(task_of(tmp_path / "plain", iterations=40, sh_every=10)).field
    assert not torch.equal(field.parameters["means"], plain.parameters["means"])


def test_an_interrupted_fit_goes_on_to_the_same_bits(tmp_path):
    whole = fit_gaussians(task_of(tmp_path / "whole", iterations=60)).field
    task = task_of(tmp_path / "parts", iterations=60)
    start = seed_gaussians(task.images, task.views, SEEDS, 3, 0)
    half = run(Fit(start, Baked(), task.images, task.settings.phase, 0), 45)
    half.seconds = 1000.0
    checkpoint.save(task.output / checkpoint.FOLDER, half)
    fitted = fit_gaussians(task)
    assert fitted.seconds > 1000
    require_equal(fitted.field.parameters, whole.parameters)


def test_the_part_of_a_view_that_is_fitted_shows_all_gaussians(tmp_path):
    """The box of surfels is as good for Gaussians, whose filter is wider."""
    images = ball_images()
    for seed in range(20):
        generator = torch.Generator().manual_seed(seed)
        p = seed_gaussians(images, ViewSet(tmp_path, [], [], {}), SEEDS, 0, seed)
        p["scales"] = p["scales"] + 0.5 * torch.randn(80, 3, generator=generator)
        model = Gaussians({**p, "opacities": torch.full((80,), 4.0)})
        camera = images.cameras[seed % 6]
        box = screen_box(p, model.shading.options, camera).within(SIZE, SIZE)
        alpha = model.render(camera).alpha
        alpha[box.top : box.bottom, box.left : box.right] = 0
        assert not alpha.any()


def test_seeds_are_grey_from_everywhere_and_as_thick_as_wide(tmp_path):
    parameters = seed_gaussians(ball_images(), ViewSet(tmp_path, [], [], {}), SEEDS, 2, 0)
    assert parameters["scales"].shape == (80, 3)
    assert torch.equal(parameters["scales"][:, 2], parameters["scales"][:, :2].amin(dim=1))
    assert parameters["sh_rest"].shape == (80, 8, 3)
    assert not parameters["sh_rest"].any()
    shown = 0.5 + Y00 * parameters["sh"]
    assert bool(((shown > -1e-6) & (shown < 1 + 1e-6)).all())


def test_in_a_volume_they_start_where_it_shows_something_as_many_as_are_kept(tmp_path):
    volume, tf = sphere(16), {"name": "TF01", "opacity": [[0.5, 0.5], [1, 0.5]], "color": [[0, 1, 0.5, 0]]}
    views = ViewSet(tmp_path, [], [], {"tf": tf})
    p = seed_gaussians(ball_images(), views, Seeds(), 0, 0, volume, most=150)
    assert len(p["means"]) == 150
    assert float(p["means"].norm(dim=1).max()) < 0.5
