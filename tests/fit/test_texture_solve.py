"""Texels found from images: against least squares by brute force, and on views with detail of their own."""

import pytest
import torch
from torch.testing import assert_close

from tests.fit.scenes import HEADLIGHT, ball_seeds, cameras, images_of, new_fit, run, striped
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import ShadingModel, raw_material
from texgs.fit.settings import Densify, TextureKeys
from texgs.fit.texels import look, sizes_for_budget, textured
from texgs.fit.texture_solve import curvature, sampled_error, solve


@pytest.fixture(scope="module")
def images():
    return striped()


@pytest.fixture(scope="module")
def start(images):
    rest = Densify(start=10, stop=80, every=10, threshold=1e-5, cap=150)
    fit = run(new_fit(images, ball_seeds(opacity=0.5), iterations=150, densify=rest))
    p = {name: x.detach() for name, x in fit.parameters.items()}
    return textured(Surfels(p, fit.shading), torch.full((3,), 0.5), sizes_for_budget(p["scales"].exp(), 3000))


def squared(model, images):
    targets = [images.target(i) for i in range(len(images))]
    return sum(float((model.render(t.camera, t.light).color - t.color).square().sum()) for t in targets)


def solved_from(model, images, **keys):
    return solve(model, images, look(model, images, "").curvature, TextureKeys(**keys), 0, "")


def one_surfel():
    """A surfel of 4 x 4 texels seen from the front, and images of a known texture on it."""
    p = {**ball_seeds(count=10), **raw_material(0.6, 0.3, 0.01, 20, "bounded")}
    p = {name: x[:1] for name, x in p.items()}
    p |= {"means": torch.zeros(1, 3), "quats": torch.tensor([[0.7, 0.0, 0.7, 0.0]])}
    p |= {"scales": torch.full((1, 2), 0.15).log(), "opacities": torch.tensor([4.0])}
    model = textured(
        Surfels(p, ShadingModel()), torch.full((3,), 0.5), torch.tensor([[4, 4]], dtype=torch.int32)
    )
    texels = torch.rand(16, 3, generator=torch.Generator().manual_seed(3)) * 0.4 - 0.2
    views = [camera for camera in cameras(8, 32) if abs(float(camera.position[0])) > 0.7]
    known = Surfels({**model.parameters, "texels": texels}, model.shading)
    planes = [
        torch.cat([known.render(c, HEADLIGHT).color.permute(2, 0, 1), torch.ones(1, 32, 32)]) for c in views
    ]
    return model, texels, images_of(planes, views)


def dense(model, images):
    """Columns of one channel's matrix A [V H W, T], one texel at a time."""
    base = [model.render(c, HEADLIGHT).color for c in images.cameras]
    columns = []
    for texel in range(len(model.parameters["texels"])):
        unit = torch.zeros_like(model.parameters["texels"])
        unit[texel] = 1
        lit = Surfels({**model.parameters, "texels": unit}, model.shading)
        shown = [lit.render(c, HEADLIGHT).color - b for c, b in zip(images.cameras, base, strict=True)]
        columns.append(torch.stack(shown)[..., 0].flatten())
    return torch.stack(columns, dim=1).double()


def test_solve_agrees_with_dense_least_squares():
    model, _, images = one_surfel()
    A = dense(model, images)
    base = torch.stack([model.render(c, HEADLIGHT).color for c in images.cameras])
    wanted = torch.stack([images.target(i).color for i in range(len(images))])
    residual = (wanted - base).flatten(end_dim=2).double()
    exact = torch.linalg.lstsq(A, residual).solution
    solved = solved_from(model, images, sweeps=60, ridge=0.05)
    texels = solved.parameters["texels"].double()
    is_seen = A.sum(dim=0) > 0.05 * A.sum(dim=0).max()  # the corners hardly are
    assert int(is_seen.sum()) >= 12
    assert_close(texels[is_seen], exact[is_seen], atol=0.02, rtol=0)
    left = ((A @ texels - residual).square().sum() / residual.square().sum()).item()
    assert left < 5e-3


def test_curvature_is_that_of_the_dense_matrix_among_other_surfels():
    model, _, images = one_surfel()
    A = dense(model, images).reshape(len(images), -1, 16)
    gains = [model.shading.colors(model.parameters, c, HEADLIGHT).gain.item() for c in images.cameras]
    exact = torch.stack([a.sum(dim=0) * gain for a, gain in zip(A, gains, strict=True)])  # [V, T]
    typical = exact.square().sum(dim=0) / exact.sum(dim=0)
    ours = curvature(model.parameters["sizes"], look(model, images, "").curvature)[:, 0].double()
    middle = [5, 6, 9, 10]
    assert_close(ours[middle], typical[middle], atol=0, rtol=0.25)  # texels as wide as 1.5 sigma are coarse
    assert_close(ours.sum(), typical.sum(), atol=0, rtol=0.05)


def test_curvature_bounds_that_of_a_surfel_alone():
    model, _, images = one_surfel()
    A = dense(model, images).reshape(len(images), -1, 16)
    exact = torch.stack([a.T @ a.sum(dim=1) for a in A])  # [V, T], rows of A'A summed
    curvatures = curvature(model.parameters["sizes"], look(model, images, "").curvature)[:, 0].double()
    assert (curvatures >= exact.mean(dim=0)).all()


def test_curvatures_of_texels_sum_to_those_of_surfels():
    sizes = torch.tensor([[3, 2], [1, 1], [7, 5]], dtype=torch.int32)
    of_surfels = torch.tensor([2.0, 0.5, 3.0])
    curvatures = curvature(sizes, of_surfels)[:, 0]
    assert_close(torch.stack([x.sum() for x in curvatures.split([6, 1, 35])]), of_surfels)
    assert int(curvatures[7:].argmax()) == 2 * 7 + 3  # rows of v, the middle one


def test_solve_finds_detail(start, images):
    solved = solved_from(start, images, sweeps=3, ridge=0.2)
    assert squared(solved, images) < 0.7 * squared(start, images)


def test_sampled_error_is_that_of_few_views(start, images):
    assert sampled_error(start, images) == pytest.approx(squared(start, images))


def test_texels_that_would_be_worse_are_not_kept(start, images):
    """A curvature far too small makes steps far too large."""
    wild = look(start, images, "").curvature * 1e-3
    assert solve(start, images, wild, TextureKeys(sweeps=1, ridge=0.0), 0, "") is start


def test_views_of_nothing_leave_the_texels_alone(start):
    planes = torch.ones(4, 16, 16)
    planes[3] = 0
    behind = cameras(1, 16)
    away = behind[0].viewmat.clone()
    away[2, 3] = -5.0
    blank = images_of([planes], [type(behind[0])(away, behind[0].K, 16, 16)])
    solved = solved_from(start, blank, sweeps=2, ridge=0.2)
    assert torch.equal(solved.parameters["texels"], start.parameters["texels"])
