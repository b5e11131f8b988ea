"""Attributes from a volume whose surfaces are spheres, and from noise."""

import numpy as np
import pytest
import torch
from torch.nn.functional import normalize

from tests.raster.requirements import require_equal
from tests.volume.scenes import SHELLS, ball
from texgs.core.geometry import quats_to_matrices
from texgs.fields.surfels.shading import material
from texgs.fitting.attributes import FULL_HOLD, Attributes, coherence
from texgs.volume.caster import Caster
from texgs.volume.grid import Grid
from texgs.volume.lookup import Lookup
from texgs.volume.render import Appearance
from texgs.volume.transfer import TransferFunction

from .scenes import ball_seeds, new_fit, run

ALL = TransferFunction(((-9, 0.5), (9, 0.5)), ((-9, 0, 0, 0), (9, 1, 1, 1)))


def seeds(count=80):
    return {**ball_seeds(count), "normals": torch.ones(count, 4)}


def held_to(grid, hold=None, tf=SHELLS, look=None):
    look = look or Appearance()
    return Attributes.of(Caster(grid, look), look, tf, ball_seeds(1000)["means"], hold)


def noise():
    return Grid(np.random.default_rng(0).normal(size=(48, 48, 48)).astype(np.float32))


def test_normals_are_the_radii_of_spheres_and_colors_those_of_the_function():
    means = ball_seeds(1000)["means"]
    seen = held_to(ball(), tf=ALL).at(means)
    along = (quats_to_matrices(seen["normals"])[..., 2] * normalize(means, dim=1)).sum(dim=1)
    assert along[means.norm(dim=1) > 0.05].max() < -0.99  # the ball is brightest in the middle
    value = 1 - 2 * means.norm(dim=1, keepdim=True)
    torch.testing.assert_close(seen["colors"], ((value + 9) / 18).expand(-1, 3), atol=2e-3, rtol=0)


def test_surfels_are_held_where_normals_are_alike_and_not_in_noise():
    smooth, rough = held_to(ball()), held_to(noise())
    assert smooth.coherence > 0.98
    assert smooth.hold == FULL_HOLD
    assert rough.coherence < 0.6  # that of random directions is 0.5
    assert rough.hold == 0
    assert rough.held is None
    assert held_to(noise(), hold=0.3).hold == 0.3


def test_the_material_is_that_of_the_views_as_far_as_it_can_be():
    look = Appearance(ambient=0.2, diffuse=0.6, specular=0.0, shininess=300)
    start = held_to(ball(), look=look).start(ball_seeds(9)["means"], "bounded")
    factors = {name: float(x) for name, x in material(start, "bounded").items()}
    assert factors == pytest.approx(
        {"ambient": 0.2, "diffuse": 0.6, "specular": 0, "shininess": 100}, abs=0.02
    )


def test_coherence_is_the_mean_cosine_to_the_nearest_three_by_brute_force():
    lookup, means = Lookup(Caster(noise(), Appearance()), SHELLS), ball_seeds(50)["means"]
    n = normalize(lookup.at(means, ["gradients"])["gradients"].double(), dim=1)
    near = torch.cdist(means, means).fill_diagonal_(torch.inf).topk(3, largest=False).indices
    expected = (n[:, None] * n[near]).sum(dim=2).abs().mean()
    assert coherence(lookup, means) == pytest.approx(float(expected), abs=1e-6)
    assert coherence(lookup, means[:3]) == 0


def test_held_surfels_start_as_they_are_given_and_learn_differences():
    held, start = held_to(ball(), hold=0.1), seeds()
    fit = new_fit(parameters=start, held=held, iterations=60)
    for name in ("colors", "normals"):
        torch.testing.assert_close(fit.fitted[name], start[name], atol=1e-6, rtol=0)
    own = held.at(start["means"])
    as_the_volume = new_fit(parameters={**start, **own}, held=held, iterations=60)
    assert not any(as_the_volume.parameters[name].any() for name in own)
    run(as_the_volume)
    own = held.at(as_the_volume.parameters["means"])
    for name in own:
        learned = as_the_volume.fitted[name] - own[name]
        torch.testing.assert_close(learned, as_the_volume.parameters[name], atol=1e-6, rtol=0)
        assert learned.any()


def test_the_more_they_are_held_the_nearer_they_stay():
    distances = []
    for hold in (0.0, 0.02, 0.5):
        fit = run(new_fit(parameters=seeds(), held=held_to(ball(), hold), iterations=60))
        distances.append(float(fit.parameters["colors"].detach().abs().mean()))
    assert distances[0] > 1.2 * distances[1] > 4 * distances[2]


def test_a_held_fit_that_was_stopped_ends_with_the_same_bits():
    held = held_to(ball(), hold=0.05)
    whole = run(new_fit(parameters=seeds(), held=held))
    stopped = run(new_fit(parameters=seeds(), held=held), 35)
    resumed = new_fit(parameters=seeds(), held=held)
    resumed.restore(stopped.state())
    require_equal(run(resumed).fitted, whole.fitted)
