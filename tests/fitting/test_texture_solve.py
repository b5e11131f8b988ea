"""Texels found from images: against least squares by brute force, a plain loop of Adam, and known colours."""

from dataclasses import replace

import pytest
import torch
from torch.testing import assert_close

from tests.fitting.scenes import (
    HEADLIGHT,
    ball_seeds,
    blank_images,
    cameras,
    images_of,
    model_of,
    new_fit,
    run,
    striped,
)  # fmt: skip
from tests.refusals import refused
from texgs.core.errors import FitError
from texgs.core.light import random_lights
from texgs.fields.splats import geometry
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import ShadingModel, material, raw_material
from texgs.fields.surfels.texels import owners
from texgs.fitting.settings import Densify, TextureKeys
from texgs.fitting.texels import add_texture, gather_sight, sizes_for_budget, texturize, without_offset
from texgs.fitting.texture_solve import MAX_TEXEL_CHANGE, curvature, refine, share_of, solve, texel_map
from texgs.raster import Texture, rasterize, reference
from texgs.raster.losses import l1_dssim
from texgs.raster.reference import shading
from texgs.volume.cameras import farthest_first

PLAIN = TextureKeys()
PAPER = TextureKeys(rate=0.025, palette_rate=0.01, final=1.0)
GREY = torch.full((3,), 0.5)


@pytest.fixture(scope="module")
def images():
    return striped()


@pytest.fixture(scope="module")
def plain(images):
    rest = Densify(start=10, stop=80, every=10, threshold=1e-5, cap=150)
    return model_of(run(new_fit(images, ball_seeds(opacity=0.5), iterations=150, densify=rest)))


@pytest.fixture(scope="module")
def start(plain):
    return add_texture(plain, GREY, sizes_for_budget(plain.parameters["scales"].exp(), 3000))


@pytest.fixture(scope="module")
def bare(start):
    """The same as the paper begins: offsets of surfels are in their texels."""
    return without_offset(start)


def changed(model, **parameters):
    return replace(model, parameters={**model.parameters, **parameters})


def view_of(camera):
    return camera.viewmat, camera.K, camera.width, camera.height


def drawn(model, camera, **what):
    return rasterize(*geometry(model.parameters), *view_of(camera), options=model.shading.options, **what)


def squared(model, images):
    targets = [images.target(i) for i in range(len(images))]
    return sum(float((model.render(t.camera, t.light).color - t.color).square().sum()) for t in targets)


def solved_from(model, images, **keys):
    return solve(model, images, gather_sight(model, images, "").curvature, TextureKeys(**keys), 0, "")


def refined(model, images, iterations, keys=PLAIN, **changes):
    return refine(model, images, replace(keys, iterations=iterations, **changes), 0, "")


def one_surfel():
    """A surfel of 4 x 4 texels seen from the front, and images of a known texture on it."""
    p = {**ball_seeds(count=10), **raw_material(0.6, 0.3, 0.01, 20, "bounded")}
    p = {name: x[:1] for name, x in p.items()}
    p |= {"means": torch.zeros(1, 3), "quats": torch.tensor([[0.7, 0.0, 0.7, 0.0]])}
    p |= {"scales": torch.full((1, 2), 0.15).log(), "opacities": torch.tensor([4.0])}
    model = add_texture(Surfels(p, ShadingModel()), GREY, torch.tensor([[4, 4]], dtype=torch.int32))
    texels = torch.rand(16, 3, generator=torch.Generator().manual_seed(3)) * 0.4 - 0.2
    views = [camera for camera in cameras(8, 32) if abs(float(camera.position[0])) > 0.7]
    known = changed(model, texels=texels)
    planes = [
        torch.cat([known.render(c, HEADLIGHT).color.permute(2, 0, 1), torch.ones(1, 32, 32)]) for c in views
    ]
    return model, images_of(planes, views)


def dense(model, images):
    """Columns of one channel's matrix A [V H W, T], one texel at a time."""
    base = [model.render(c, HEADLIGHT).color for c in images.cameras]
    columns = []
    for texel in range(len(model.parameters["texels"])):
        unit = torch.zeros_like(model.parameters["texels"])
        unit[texel] = 1
        lit = changed(model, texels=unit)
        shown = [lit.render(c, HEADLIGHT).color - b for c, b in zip(images.cameras, base, strict=True)]
        columns.append(torch.stack(shown)[..., 0].flatten())
    return torch.stack(columns, dim=1).double()


def test_solve_agrees_with_dense_least_squares():
    model, images = one_surfel()
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
    model, images = one_surfel()
    A = dense(model, images).reshape(len(images), -1, 16)
    gains = [model.shading.colors(model.parameters, c, HEADLIGHT).gain.item() for c in images.cameras]
    exact = torch.stack([a.sum(dim=0) * gain for a, gain in zip(A, gains, strict=True)])  # [V, T]
    typical = exact.square().sum(dim=0) / exact.sum(dim=0)
    ours = curvature(model.parameters["sizes"], gather_sight(model, images, "").curvature)[:, 0].double()
    middle = [5, 6, 9, 10]
    assert_close(ours[middle], typical[middle], atol=0, rtol=0.25)  # texels as wide as 1.5 sigma are coarse
    assert_close(ours.sum(), typical.sum(), atol=0, rtol=0.05)


def test_curvatures_of_texels_sum_to_those_of_surfels():
    sizes = torch.tensor([[3, 2], [1, 1], [7, 5]], dtype=torch.int32)
    of_surfels = torch.tensor([2.0, 0.5, 3.0])
    curvatures = curvature(sizes, of_surfels)[:, 0]
    assert_close(torch.stack([x.sum() for x in curvatures.split([6, 1, 35])]), of_surfels)
    assert int(curvatures[7:].argmax()) == 2 * 7 + 3  # rows of v, the middle one


def moved(model, texels):
    return changed(model, texels=model.parameters["texels"] + texels)


@pytest.mark.parametrize("scale", [1.0, 0.1, -1.0])
def test_the_share_of_the_way_is_that_of_a_search_along_it(start, images, scale):
    """With the error of all views at 101 places of the way, brightest colours not clamped."""
    towards = solved_from(start, images, sweeps=3).parameters["texels"] * scale
    errors = [squared(moved(start, towards * step / 100), images) for step in range(101)]
    best = errors.index(min(errors)) / 100
    share = share_of(moved(start, towards), start, images, range(len(images)))
    assert share == pytest.approx(best, abs=0.01)
    assert (scale > 0) == (share > 0)


def test_views_that_the_solver_does_not_see_tell_how_far_to_go(start, images):
    """Half of the six views are noise: on the others none of it is a gain."""
    order, noise = farthest_first(images.cameras), images.planes.clone()
    noise[order[:3], :3] = torch.randint(0, 256, noise[:3, :3].shape, dtype=torch.uint8)
    torn = replace(images, planes=noise)
    halves = solved_from(start, torn, views=0.5)
    rest = torn.planes[order[3:]], [torn.cameras[i] for i in order[3:]], [torn.lights[i] for i in order[3:]]
    others = type(images)(*rest)
    assert squared(halves, others) <= 1.0001 * squared(start, others)


def test_texels_that_would_be_worse_are_hardly_followed(start, images):
    """A curvature far too small makes steps far too large."""
    wild = gather_sight(start, images, "").curvature * 1e-3
    kept = solve(start, images, wild, TextureKeys(sweeps=1, ridge=0.0, views=1.0), 0, "")
    assert squared(kept, images) <= 1.0001 * squared(start, images)


def test_views_of_nothing_leave_the_texels_alone(start):
    camera = cameras(1, 16)[0]
    viewmat = camera.viewmat.clone()
    viewmat[2, 3] = -5.0
    blank = replace(blank_images(1, 16), cameras=[replace(camera, viewmat=viewmat)])
    solved = solved_from(start, blank, sweeps=2, ridge=0.2)
    assert torch.equal(solved.parameters["texels"], start.parameters["texels"])


def oracle(model, images, rates, sparsity, orders):
    """The loop with whole images, torch's Adam and its constant or falling rates."""
    learnt = {name: model.parameters[name].clone().requires_grad_() for name in ("texels", "palette")}
    adam = torch.optim.Adam([{"params": [x]} for x in learnt.values()], eps=1e-15)
    moving = changed(model, **learnt)
    for view, both in zip(orders, rates, strict=True):
        target = images.target(view)
        layout = (model.parameters["sizes"], model.parameters["offsets"])
        zero, one = torch.zeros(len(model), 3), torch.ones(len(model))
        alone = drawn(model, target.camera, texture=Texture(zero, one, learnt["texels"], *layout)).color
        image = moving.render(target.camera, target.light).color
        loss = l1_dssim(image, target.color, 0.2) + sparsity * alone.abs().mean()
        for group, rate in zip(adam.param_groups, both, strict=True):
            group["lr"] = rate
        adam.zero_grad()
        loss.backward()
        adam.step()
    return {name: x.detach() for name, x in learnt.items()}


@pytest.mark.parametrize(("final", "sparsity"), [(1.0, 0.0), (1.0, 0.5), (0.1, 0.0)])
def test_it_is_adam_on_texels_and_palette_with_rates_of_their_own(bare, images, final, sparsity):
    steps = 6  # all views once
    falls = [final ** (step / steps) for step in range(steps)]
    order = torch.randperm(6, generator=torch.Generator().manual_seed(0)).tolist()[::-1]
    expected = oracle(bare, images, [(0.025 * f, 0.01 * f) for f in falls], sparsity, order)
    found = refined(bare, images, steps, PAPER, final=final, sparsity=sparsity).parameters
    # D-SSIM of the visible part differs by what its windows do not see beyond the border.
    assert_close(found["palette"], expected["palette"], atol=2e-4, rtol=0)
    error = (found["texels"] - expected["texels"]).abs()
    assert float(error.mean()) < 2e-4
    assert float((found["texels"] - bare.parameters["texels"]).abs().mean()) > 100 * float(error.mean())


def test_gradients_of_palette_and_texels_are_those_of_the_definition(bare, images):
    camera, target = images.cameras[0], images.target(0)
    p = {name: x.double() if x.is_floating_point() else x for name, x in bare.parameters.items()}
    leaves = {name: bare.parameters[name].clone().requires_grad_() for name in ("palette", "texels")}
    exact = {name: p[name].clone().requires_grad_() for name in leaves}
    (changed(bare, **leaves).render(camera).color - target.color).square().sum().backward()
    a, d, s, b = material(p, bare.shading.material).values()
    base, gain = shading.blinn_phong(
        *(exact["palette"].expand(len(bare), 3), a, d, s, b, p["means"], p["quats"]),
        camera.position.double(),
        facing=bare.shading.facing,
    )
    texture = Texture(base.clamp(0, 1), gain, exact["texels"], p["sizes"], p["offsets"])
    image = reference.rasterize(
        *geometry(p),
        *(camera.viewmat.double(), camera.K.double(), camera.width, camera.height),
        texture=texture,
        background=torch.ones(3).double(),
        options=bare.shading.options,
    ).color
    (image - target.color.double()).square().sum().backward()
    for name in leaves:
        scale = float(exact[name].grad.abs().max())
        assert_close(leaves[name].grad.double(), exact[name].grad, atol=1e-4 * scale, rtol=1e-3)  # float32


def test_the_texel_map_shows_texels_without_palette_and_light(bare, images):
    camera, colors = images.cameras[0], torch.rand(len(bare), 3) - 0.5
    place, surfel = owners(bare.parameters)
    texels = torch.empty_like(bare.parameters["texels"])
    texels[place] = colors[surfel]
    other = changed(bare, texels=texels, palette=torch.tensor([0.9, 0.1, 0.2]), ambient=torch.tensor([3.0]))
    shown = drawn(bare, camera, features=colors)
    assert_close(texel_map(other, camera), shown.color, atol=1e-5, rtol=0)


def test_adam_finds_detail_and_without_a_rate_the_palette_stays(bare, images):
    found = refined(bare, images, 120)
    assert squared(found, images) < 0.95 * squared(bare, images)
    assert torch.equal(found.parameters["palette"], bare.parameters["palette"])


def test_the_palette_alone_finds_the_palette_of_the_images(bare):
    known = torch.tensor([0.35, 0.55, 0.7])
    views = cameras()
    planes = [changed(bare, palette=known).render(view, HEADLIGHT) for view in views]
    images = images_of([torch.cat([r.color.permute(2, 0, 1), r.alpha[None]]) for r in planes], views)
    model = refined(bare, images, 200, PAPER, rate=0.0, final=0.02)
    assert torch.equal(model.parameters["texels"], bare.parameters["texels"])
    assert_close(model.parameters["palette"], known, atol=0.01, rtol=0)  # images have 8 bits and are clamped


def test_sparsity_moves_what_texels_have_in_common_to_the_palette(bare, images):
    shifted = changed(bare, palette=bare.parameters["palette"] - 0.2, texels=bare.parameters["texels"] + 0.2)
    sizes, palettes = [], []
    for sparsity in (0.0, 3.0):
        found = refined(shifted, images, 120, PAPER, sparsity=sparsity, rate=0.01)
        sizes.append(float(texel_map(found, images.cameras[0]).abs().mean()))
        palettes.append(found.parameters["palette"])
    assert sizes[1] < 0.5 * sizes[0]
    assert (palettes[1] - palettes[0]).mean() > 0.02


def test_the_palette_remains_a_colour(bare, images):
    dark = changed(bare, palette=torch.full((3,), 0.01), texels=bare.parameters["texels"] + 0.8)
    palette = refined(dark, images, 5, PAPER, palette_rate=0.5).parameters["palette"]
    assert ((palette >= 0) & (palette <= 1)).all()


def test_the_paper_recipe_begins_with_the_mean_colour(plain, images):
    keys = replace(PAPER, texels=2000, sweeps=0, iterations=1, has_offset=False)
    fitted = texturize(plain, images, keys)
    still = texturize(plain, images, replace(keys, palette_rate=0.0))
    moved = (fitted.parameters["palette"] - still.parameters["palette"]).abs()
    assert_close(moved, torch.full((3,), 0.01))  # Adam's first step is its rate


def test_numbers_that_are_not_finite_are_reported(bare, images):
    model = changed(bare, colors=bare.parameters["colors"] * torch.nan)
    refused(lambda: refined(model, images, 2), "texture: texels: .*finite", FitError)


def test_lights_from_many_sides_do_not_drive_texels_away(start):
    """Most of what such views show is dark and even, where D-SSIM is steep."""
    dim = {name: x.repeat(1) for name, x in raw_material(0.05, 0.9, 0.01, 20, "bounded").items()}
    model = changed(start, **dim)
    wanted = changed(model, texels=0.2 * torch.rand_like(model.parameters["texels"]) - 0.1)
    views, lights = cameras(40, 48), random_lights(40, 3)
    planes = []
    with torch.no_grad():
        for camera, light in zip(views, lights, strict=True):
            seen = wanted.render(camera, light)
            planes.append(torch.cat([seen.color.clamp(0, 1).permute(2, 0, 1), seen.alpha[None]]))
    images = replace(images_of(planes, views), lights=lights)
    solved = solved_from(model, images, sweeps=4)
    texels = solved.parameters["texels"]
    assert 0 < float(texels.abs().max()) <= MAX_TEXEL_CHANGE
    assert squared(solved, images) < 0.7 * squared(model, images)
