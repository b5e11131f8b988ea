"""Colours found from observations: against dense least squares, and Adam against the same problem."""

import pytest
import torch
from torch.testing import assert_close

from tests.edit.scenes import around, shell
from texgs.core.camera import orbit
from texgs.core.light import HEADLIGHT
from texgs.edit.observations import observe, render_views
from texgs.edit.texel_solver import back_project, fill_unseen, image_loss, learn, seen_texels, solve
from texgs.fields.optimizer import Rate
from texgs.fields.splats import geometry
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import material
from texgs.fields.surfels.texels import bare_colors, owners, with_colors
from texgs.raster import Texture, reference
from texgs.raster.losses import l1_dssim
from texgs.raster.reference.losses import l1_dssim as l1_dssim_by_definition
from texgs.raster.reference.shading import blinn_phong

STRIPES = 9.0  # for each world unit


@pytest.fixture(scope="module")
def model():
    return shell(count=80, texels=4)


@pytest.fixture(scope="module")
def problem(model):
    """Rows of observations of stripes on the surface."""
    views = render_views(model, around(6, 32), None)
    is_dark = (views.points[..., 1:2] * STRIPES) % 1 < 0.5
    alpha = views.alphas[..., None]
    edited = torch.where(is_dark, 0.2, 0.6) * alpha.expand(-1, -1, -1, 3) + 1 - alpha
    return observe(model, views, edited, None, (2.0, 1.0, 0.5))


def flat(rows):
    return [observation for row in rows for observation in row]


def error(observations, colors):
    return sum(float((each.image(colors) - each.wanted).square().sum()) for each in observations)


def dense(observations, model):
    """Matrix [pixels, T] of one channel and its right-hand side [pixels, 3], float64."""
    columns, count = [], len(model.parameters["texels"])
    for texel in range(count):
        unit = torch.zeros(count, 3)
        unit[texel] = 1
        images = [each.image(unit, plain=True)[..., 0] for each in observations]
        columns.append(torch.cat([image.flatten() for image in images]))
    black = torch.zeros(count, 3)
    rest = [(each.wanted - each.image(black)).reshape(-1, 3) for each in observations]
    return torch.stack(columns, dim=1).double(), torch.cat(rest).double()


@pytest.fixture(scope="module")
def few():
    """A problem small enough to write down: one opacity, coarse textures, colours that can be had."""
    model = shell(count=24, texels=3, opacity=2.0)
    views = render_views(model, around(4, 24), None)
    known = torch.rand(len(model.parameters["texels"]), 3, generator=torch.Generator().manual_seed(5))
    edited = render_views(with_colors(model, known), around(4, 24), None).images
    return model, flat(observe(model, views, edited, None, (1.0,))), known


def test_sums_are_those_of_the_dense_matrix(few):
    model, observations, _ = few
    A, wanted = dense(observations, model)
    sums = back_project(observations, model)
    pixels = [e.rest.numel() for e in observations]
    shows = torch.cat([1 - e.rest.flatten() for e in observations]).double() > 1e-4
    assert_close(sums.weights.double(), A[shows].sum(dim=0), atol=1e-3, rtol=1e-4)
    gains = A.sum(dim=1, keepdim=True)
    means = (A.T @ (wanted / gains.clamp_min(1e-4)).clamp(0, 1)) / A.sum(dim=0)[:, None]
    solid = A.sum(dim=0) > 0.5
    assert_close(sums.colors[solid].double(), means[solid], atol=2e-3, rtol=0)
    rows = torch.stack([a.T @ a.sum(dim=1) for a in A.split(pixels)])  # [V, T] of A'A 1
    assert_close(sums.curvature.double(), rows.square().sum(0) / rows.sum(0), atol=1e-4, rtol=1e-3)


def test_solve_agrees_with_dense_least_squares(few):
    model, observations, known = few
    A, wanted = dense(observations, model)
    sums = back_project(observations, model)
    start = fill_unseen(sums.colors, sums.weights, model)
    generator = torch.Generator().manual_seed(0)
    texels = solve(observations, sums.curvature, start, sweeps=150, generator=generator, title="")
    exact = torch.linalg.lstsq(A, wanted).solution
    left = (A @ exact - wanted).square().sum()
    zero = (A @ start.double() - wanted).square().sum()
    assert (A @ texels.double() - wanted).square().sum() < left + 0.01 * (zero - left)
    clear = A.square().sum(dim=0) > 3.0
    assert int(clear.sum()) > 10
    assert (texels[clear] - known[clear]).abs().mean() < 0.25 * (start[clear] - known[clear]).abs().mean()


def test_three_sweeps_are_as_good_as_the_papers_iterations(problem, model):
    """1,500 of Adam at falling opacity against 54 steps: the squared error of the views, to 0.1 dB."""
    sums = back_project(flat(problem), model)
    start = fill_unseen(sums.colors, sums.weights, model)
    solved = solve(flat(problem), sums.curvature, start, sweeps=3, generator=torch.Generator(), title="")
    learned = by_adam(problem, model, 1500)
    assert error(problem[1], start) > 1.1 * error(problem[1], solved)
    assert error(problem[1], solved) < 1.023 * error(problem[1], learned)  # 0.1 dB
    assert 0 <= float(solved.min()) <= float(solved.max()) <= 1


def by_adam(rows, model, steps):
    generator = torch.Generator().manual_seed(0)
    start, rate = bare_colors(model), Rate(0.025, 0.1)
    return learn(rows, start, rate=rate, steps=steps, generator=generator, title="")


@pytest.mark.parametrize("share", ["all", "some"])
@pytest.mark.parametrize("opacity", [2.0, 0.5])
def test_the_papers_gradient_is_that_of_the_whole_image_by_definition(opacity, share):
    """The edited image as it is, L1 + D-SSIM over all of it: float64, every surfel at every pixel."""
    model, camera = shell(count=24, texels=3, opacity=0.5), orbit(20, 30, 2.5, 60, 96, 80)
    changing = model.parameters["means"][:, 1] > (-9 if share == "all" else 0)
    edited = torch.rand(1, 80, 96, 3, generator=torch.Generator().manual_seed(4))
    views = render_views(model, [camera], HEADLIGHT)
    rows = observe(model, views, edited, HEADLIGHT, (opacity,), changing, target="images")
    colors = bare_colors(model).requires_grad_()
    image_loss(rows[0][0], colors).backward()
    exact = colors.detach().double().requires_grad_()
    image = by_definition(model, camera, exact, opacity)
    (l1_dssim_by_definition(image, edited[0].double()) * 80 * 96).backward()
    place, surfel = owners(model.parameters)
    mine = place[changing[surfel]]
    scale = float(exact.grad.abs().max())
    assert rows[0][0].wanted[..., 0].numel() < 0.7 * 80 * 96, "a part of the view"
    assert_close(colors.grad[mine].double(), exact.grad[mine], atol=1e-4 * scale, rtol=1e-3)
    assert colors.grad[place[~changing[surfel]]].abs().sum() == 0


def by_definition(model, camera, colors, opacity):
    """The view of bare colours [T, 3] under a headlight, over white, in float64."""
    p = {name: x.double() if x.is_floating_point() else x for name, x in model.parameters.items()}
    *splats, opacities = geometry(p)
    factors = material(p, model.shading.material).values()
    lit = blinn_phong(
        torch.zeros_like(p["means"]), *factors, p["means"], p["quats"], camera.position.double(), facing=True
    )
    return reference.rasterize(
        *(*splats, (opacity * opacities).clamp_max(1)),
        *(camera.viewmat.double(), camera.K.double(), camera.width, camera.height),
        texture=Texture(*lit, colors, p["sizes"], p["offsets"]),
        background=torch.ones(3).double(),
        options=model.shading.options,
    ).color


class Rows(list):
    """Rows that tell in which order they were asked for."""

    def __init__(self, rows):
        super().__init__(rows)
        self.asked = []

    def __getitem__(self, index):
        self.asked.append(index)
        return super().__getitem__(index)


def test_adam_lowers_its_loss_and_follows_the_opacities(problem, model):
    rows = Rows(problem)
    learned = by_adam(rows, model, 90)
    assert rows.asked == [0] * 30 + [1] * 30 + [2] * 30
    after, before = (
        sum(l1_dssim(each.image(colors), each.wanted, 0.2).item() for each in problem[-1])
        for colors in (learned, bare_colors(model))
    )
    assert after < 0.8 * before


def test_unseen_texels_take_the_mean_of_their_surfel():
    model = shell(count=10, texels=2)
    nothing = fill_unseen(torch.zeros(40, 3), torch.zeros(40), model)  # as back_project has it
    assert torch.equal(nothing, bare_colors(model))
    place, surfel = owners(model.parameters)
    colors = torch.rand(40, 3, generator=torch.Generator().manual_seed(0))
    weights = torch.full((40,), 2.0)
    mine = place[surfel == 3]
    weights[mine[0]], weights[mine[1]], weights[mine[2:]] = 1.0, 3.0, 0.0
    filled = fill_unseen(colors, weights, model)
    expected = (colors[mine[0]] + 3 * colors[mine[1]]) / 4
    assert_close(filled[mine[2:]], expected.expand(2, 3), atol=0.01, rtol=0)
    kept = weights > 0
    assert_close(filled[kept], colors[kept], atol=0.02, rtol=0)
    assert torch.equal(seen_texels(weights), kept)


@pytest.mark.parametrize("glimpse", [0.0, 1e-4])
def test_hidden_surfels_take_the_colour_of_the_nearest_seen_one(glimpse):
    """Even if they are glimpsed through what hides them, and would be the colour of that."""
    model = shell(count=10, texels=2)
    means = torch.zeros(10, 3)
    means[:, 0] = torch.arange(10.0) ** 1.1
    model = Surfels({**model.parameters, "means": means}, model.shading)
    place, surfel = owners(model.parameters)
    colors = torch.ones(40, 3)
    weights = torch.full((40,), glimpse)
    is_seen = (surfel == 2) | (surfel == 7)
    weights[place[is_seen]] = 1.0
    colors[place[is_seen]] = (surfel[is_seen] / 10)[:, None].expand(-1, 3)
    filled = fill_unseen(colors, weights, model)[place, 0].reshape(10, 4)[:, 0]
    assert_close(filled, torch.tensor([0.2] * 5 + [0.7] * 5), atol=0.08, rtol=0)
