"""StyleRF-VolVis on a small ball: each of its parts against a few lines of its own, and the whole."""

from dataclasses import replace

import pytest
import torch

from tests.edit.scenes import plain_style
from tests.fitting.scenes import ball_images, cameras
from tests.fitting.test_palette import SETTINGS
from tests.refusals import refused
from texgs.edit import palette_style
from texgs.edit.methods.style_baselines import StyleRfKeys
from texgs.edit.objective import Objective
from texgs.edit.palette_style import PalettePainting, stylize_palette
from texgs.edit.style_loop import learn_style
from texgs.edit.style_picture import StylePicture
from texgs.fields.palette.networks import free_color, palette_color
from texgs.fields.palette.rendering import points_on, visible_points
from texgs.fitting.palette import PaletteFit
from texgs.models.pictures import picture
from texgs.raster.voxels import camera_rays

STEPS, VARIATION = 60, 0.1  # of the distillation; weight of total variation
RECIPE = StyleRfKeys(nnfm=0.0, patches=50.0).recipe(6, 0, reduce=2, rate=0.01)
STYLE = StylePicture.of(picture("dots", 96))


@pytest.fixture(scope="module")
def images():
    return ball_images(count=6, size=48)


@pytest.fixture(scope="module")
def field(images):
    """A ball with two palette colours, of which the second is that of its shadows or nothing."""
    fit = PaletteFit(images, replace(SETTINGS, colors=2))
    for _ in fit.run():
        pass
    return fit.field({})


def one_colored(field):
    """The same field with the first palette colour alone."""
    colors = field.parameters["palette.colors"][:1]
    mixture = field.parameters["mixture.0"]  # rows: 2 shares, 2 x 3 offsets, radiance
    kept = torch.cat([mixture[:1], mixture[2:5], mixture[8:]])
    return replace(field, parameters={**field.parameters, "palette.colors": colors, "mixture.0": kept})


def test_deferred_gradients_are_those_of_one_graph(field, images, vgg, monkeypatch):
    monkeypatch.setattr(palette_style, "RAYS", 100)
    monkeypatch.setattr(palette_style, "MIN_WEIGHT", -1.0)
    field, camera = one_colored(field), images.cameras[0]
    recipe = replace(RECIPE, features=1.0)
    objective = Objective.of(recipe, STYLE.scaled(48), 2, vgg, None)
    run = PalettePainting(field, [camera], [objective], [0.4], 0.7, 0.0, torch.Generator().manual_seed(0))
    (layer,) = run.layers(camera)
    monkeypatch.setattr(run, "step", lambda iteration: None)
    losses = learn_style(run, 1, replace(recipe, iterations=1), "test")
    values = {name: each[0] for name, each in losses.items()}
    deferred = {name: x.grad.clone() for name, x in run.free.items()}

    geometry, parameters = field.geometry, field.parameters
    pixels = camera_rays(camera).flatten(0, 1)
    points = points_on(pixels, geometry, parameters)
    shows = visible_points(points, -1.0)
    learned = {name: x.detach().requires_grad_() for name, x in run.free.items()}
    lit = torch.cat([part.light for part in layer])
    color = shows.blend(free_color(points.at, learned, geometry.levels) + lit, len(pixels))
    alpha = shows.blend(torch.ones(len(points.ray), 1), len(pixels))
    raw = (color + 0.4 * (1 - alpha)).T.unflatten(1, (48, 48))
    image = raw.detach().clamp(0, 1).requires_grad_()
    terms = objective.terms(image, alpha.reshape(48, 48), 0)
    down, right = image.diff(dim=1).square().mean(), image.diff(dim=2).square().mean()
    terms["variation"] = 0.7 * (down + right) / 2
    assert values == pytest.approx({name: float(x.detach()) for name, x in terms.items()}, rel=1e-4, abs=1e-9)
    (gradient,) = torch.autograd.grad(sum(terms.values()), image)
    farther = (raw > 1) & (gradient < 0) | (raw < 0) & (gradient > 0)
    raw.backward(gradient.masked_fill(farther, 0))
    for name, x in learned.items():
        torch.testing.assert_close(deferred[name], x.grad, atol=1e-6, rtol=1e-3)


@pytest.mark.stages
def test_free_colours_learn_those_of_the_recoloured_palette(field, images):
    colors = torch.tensor([[0.1, 0.7, 0.3], [0.2, 0.2, 0.9]])
    recolored = replace(field, parameters={**field.parameters, "palette.colors": colors})
    run = PalettePainting(recolored, [], [], [], 0.0, 0.0, torch.Generator().manual_seed(0))
    error = run.distil(images, 150, "test")
    with torch.no_grad():
        points = points_on(camera_rays(images.cameras[1]).flatten(0, 1), field.geometry, field.parameters)
        at = visible_points(points, 1e-3).points.at
        wanted = palette_color(at, recolored.parameters, field.geometry.levels).color
        left = (free_color(at, run.free, field.geometry.levels) - wanted).square().mean().sqrt()
    assert error < 0.05
    assert float(left) < 0.05
    before, after = (each.render(images.cameras[1]).color for each in (recolored, run.field))
    assert float((before - after).abs().mean()) < 0.01


def test_only_colours_change(field, images, vgg):
    before = {name: x.clone() for name, x in field.parameters.items()}
    recipe = replace(RECIPE, features=1.0, iterations=2)
    edited, losses, _ = stylize_palette(field, images, [STYLE, STYLE], recipe, 3, VARIATION, vgg)
    assert all(torch.equal(x, field.parameters[name]) for name, x in before.items()), "the field given"
    changed = {name for name, x in edited.parameters.items() if name not in before}
    assert changed == {"free.table", "free.0", "free.1", "free.2"}
    for name, x in before.items():
        assert torch.equal(edited.parameters[name], x) == (name != "palette.colors"), name
    assert edited.geometry is field.geometry
    assert {len(values) for values in losses.values()} == {2}
    assert set(losses) == {"patches", "variation", "nnfm"}
    camera = images.cameras[0]
    assert torch.equal(edited.render(camera).alpha, field.render(camera).alpha)


def test_a_plain_style_becomes_the_colour_of_the_ball(field, images):
    field, style = one_colored(field), plain_style([0.2, 0.6, 0.3])
    edited, *_ = stylize_palette(field, images, [style], replace(RECIPE, iterations=60), STEPS, 0.0)
    torch.testing.assert_close(edited.colors, style.mean[None])
    shown = edited.render(cameras(1, 48)[0])
    color = (shown.color - 1 + shown.alpha[..., None])[shown.alpha > 0.99]
    torch.testing.assert_close(color.mean(0), style.mean, atol=0.06, rtol=0)  # the rate stays high


def test_layers_of_palette_colours_are_apart_and_together_everything_and_each_has_a_style(field, images):
    one = lambda: stylize_palette(field, images, [STYLE], RECIPE, STEPS, VARIATION)  # noqa: E731
    refused(one, "styles: expected one for each of 2 palette colours, got 1")
    camera = images.cameras[2]
    run = PalettePainting(field, [], [], [], 0.0, 0.0, torch.Generator())
    rays = camera_rays(camera).flatten(0, 1)
    points = points_on(rays, field.geometry, field.parameters)
    shares = palette_color(points.at, field.parameters, field.geometry.levels).shares
    for index, layer in enumerate(run.layers(camera)):
        sigma = points.depth * (shares.argmax(1) == index)
        depth = torch.zeros(len(rays)).index_add_(0, points.ray, sigma)
        alpha = torch.cat([part.values(run.colors(part))[:, 3] for part in layer])
        torch.testing.assert_close(alpha, 1 - torch.exp(-depth), atol=0.02, rtol=0)  # small weights are left
