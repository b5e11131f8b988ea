"""ARF on a small ball of voxels: each of its parts against a few lines of its own, and the whole."""

from dataclasses import replace

import pytest
import torch

from tests.edit.scenes import images_of, plain_style
from tests.fields.voxels.test_voxels import ball
from tests.fitting.scenes import cameras
from texgs.edit.methods.style_baselines import ArfKeys
from texgs.edit.objective import Objective
from texgs.edit.style_loop import learn_style
from texgs.edit.style_picture import StylePicture
from texgs.edit.voxels import VoxelPainting, move_colors, object_colors, recolored_images, stylize_voxels
from texgs.models.pictures import picture
from texgs.raster.voxel_grid import drop_sh, unpack_rows
from texgs.raster.voxels import render_view

WEIGHTS = {"content": 0.0, "variation": 0.1, "sh_variation": 5e-3}
RECIPE = ArfKeys(nnfm=0.0, patches=50.0).recipe(8, 0, reduce=2)
STYLE = StylePicture.of(picture("dots", 96))
A = torch.tensor([[0.6, 0.2, 0.0], [0.1, 0.5, 0.1], [0.0, 0.1, 0.7]])
B = torch.tensor([0.1, 0.05, 0.15])


def test_views_are_recoloured_as_the_grid_is():
    field = ball(degree=2)
    field = replace(field, grid=drop_sh(field.grid))
    recolored = images_of(replace(field, grid=move_colors(field.grid, A, B, is_exact=True)))
    images = recolored_images(images_of(field), A, B, foreground=True)
    assert torch.equal(images.planes[:, 3], recolored.planes[:, 3])
    assert int((images.planes.int() - recolored.planes.int()).abs().max()) <= 2, "rounding of both"
    everywhere = recolored_images(images_of(field), A, B, foreground=False)
    corner = everywhere.planes[0, :3, 0, 0].float() / 255
    torch.testing.assert_close(corner, A.sum(1) + B, atol=1 / 255, rtol=0)


def test_coefficients_are_moved_as_if_they_were_colours():
    grid = ball(degree=1).grid
    _, sh = unpack_rows(grid.rows)
    _, legacy = unpack_rows(move_colors(grid, A, B, is_exact=False).rows)
    expected = torch.einsum("ij,nkj->nki", A, sh)
    expected[:, 0] += B
    torch.testing.assert_close(legacy, expected, atol=1e-5, rtol=1e-5)


def test_colours_count_by_their_alpha():
    generator = torch.Generator().manual_seed(0)
    alpha = torch.rand(100_000, generator=generator)
    own = torch.rand(100_000, 3, generator=generator) * torch.tensor([1.0, 0.5, 0.2])
    color = alpha[:, None] * own + 1 - alpha[:, None]
    drawn = object_colors(color, alpha, generator, foreground=True)
    mean = (alpha[:, None] * own).sum(0) / alpha.sum()
    torch.testing.assert_close(drawn.mean(0), mean, atol=0.005, rtol=0)
    assert torch.equal(object_colors(color, alpha, generator, foreground=False), color)


def test_the_step_has_the_gradient_of_autograd(vgg, monkeypatch):
    field = ball(degree=0)
    images, recipe = images_of(field, count=1), replace(RECIPE, iterations=1, features=1.0)
    weights = {**WEIGHTS, "content": 0.3, "variation": 0.7}
    objective = Objective.of_views(recipe, STYLE, images.size, vgg)
    run = VoxelPainting(field.grid, field, images, objective, torch.Generator(), **weights)
    gradients = []
    monkeypatch.setattr(run, "step", lambda step: gradients.append(run.optimizer.gradient.rows.clone()))
    losses = learn_style(run, 1, recipe, "test")

    rows = field.grid.rows.clone().requires_grad_()
    view = render_view(replace(field.grid, rows=rows), images.cameras[0], field.march)
    image, target = view.color.permute(2, 0, 1), images.target(0).color.permute(2, 0, 1)
    objective = Objective.of(recipe, STYLE.scaled(48), 2, vgg, None)
    terms = objective.terms(image, view.alpha.detach(), 0)
    half = [torch.nn.functional.avg_pool2d(x[None], 2)[0] for x in (image, target)]
    content = (vgg.features(half[0]) - vgg.features(half[1])).square().mean()
    down = (image[:, 1:] - image[:, :-1]).square().mean()
    right = (image[:, :, 1:] - image[:, :, :-1]).square().mean()
    expected = {**terms, "content": 0.3 * content, "variation": 0.7 * (down + right) / 2}
    assert {name: values[0] for name, values in losses.items()} == pytest.approx(
        {name: float(term.detach()) for name, term in expected.items()}, rel=1e-4, abs=1e-9
    )
    sum(expected.values()).backward()
    color = [0, 1, 2]
    torch.testing.assert_close(gradients[0][:, color], rows.grad[:, color], atol=1e-6, rtol=1e-3)


def test_only_colours_change(vgg):
    field = ball(degree=2)
    rows = field.grid.rows.clone()
    recipe = replace(RECIPE, features=1.0, iterations=3)
    edited, losses = stylize_voxels(
        field, images_of(field), STYLE, recipe, 1.0, True, {**WEIGHTS, "content": 5e-3}, vgg
    )
    assert torch.equal(field.grid.rows, rows), "the field given is left alone"
    assert torch.equal(edited.grid.masks, field.grid.masks)
    assert torch.equal(edited.grid.rows[:, 3], field.grid.rows[:, 3]), "densities"
    assert edited.grid.degree == 0
    assert {len(values) for values in losses.values()} == {3}
    assert set(losses) == {"patches", "variation", "nnfm", "content"}


def test_a_plain_style_becomes_the_colour_of_the_ball():
    field, style = ball(degree=1), plain_style([0.2, 0.6, 0.3])
    edited, _ = stylize_voxels(field, images_of(field), style, RECIPE, 1.0, True, WEIGHTS)
    shown = render_view(edited.grid, cameras(1, 48)[0])
    color = (shown.color - 1 + shown.alpha[..., None])[shown.alpha > 0.99]
    torch.testing.assert_close(color, style.mean.expand_as(color), atol=0.01, rtol=0)


def test_in_the_end_colours_have_the_mean_and_covariance_of_the_style():
    """As far as none is cut off; the map of ARF's own code misses both."""
    field = ball(degree=0)
    soft = STYLE.image * 0.3 + 0.35
    style = StylePicture.of(soft)
    images = images_of(field)
    noise = torch.rand(images.planes[:, :3].shape, generator=torch.Generator().manual_seed(1))
    images.planes[:, :3] = (images.planes[:, :3].float() * (0.7 + 0.3 * noise)).to(torch.uint8)
    wanted = torch.cat([style.mean, style.pixels.T.cov().flatten()])
    misses = {}
    for is_exact in (True, False):
        edited, _ = stylize_voxels(field, images, style, RECIPE, 1.0, is_exact, WEIGHTS)
        generator = torch.Generator().manual_seed(3)
        run = VoxelPainting(edited.grid, edited, images, None, generator, **WEIGHTS)
        colors = run.rendered_colors(images.cameras, True, 1)
        misses[is_exact] = float((torch.cat([colors.mean(0), colors.T.cov().flatten()]) - wanted).abs().max())
    assert misses[True] < 0.02
    assert misses[False] > 5 * misses[True]
