"""Texels and palette by Adam: against a loop of a few lines, float64 renders and known colours."""

from dataclasses import replace

import pytest
import torch
from torch.testing import assert_close

from tests.fit.scenes import HEADLIGHT, ball_seeds, cameras, images_of, new_fit, run, striped
from texgs.core.errors import FitError
from texgs.fields.splats import geometry
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import material
from texgs.fields.surfels.texels import owners
from texgs.fit.settings import Densify, TextureKeys
from texgs.fit.texels import sizes_for_budget, textured, texturize, without_offset
from texgs.fit.texture_solve import refine, texel_map
from texgs.raster import Texture, rasterize, reference
from texgs.raster.losses import l1_dssim
from texgs.raster.reference import shading
from texgs.volume.images import Target

PLAIN = TextureKeys()
PAPER = TextureKeys(rate=0.025, palette_rate=0.01, final=1.0)


def refined(model, images, iterations, keys=PLAIN, **changes):
    return refine(model, images, replace(keys, iterations=iterations, **changes), 0, "")


@pytest.fixture(scope="module")
def images():
    return striped()


@pytest.fixture(scope="module")
def plain(images):
    rest = Densify(start=10, stop=80, every=10, threshold=1e-5, cap=150)
    fit = run(new_fit(images, ball_seeds(opacity=0.5), iterations=150, densify=rest))
    return Surfels({name: x.detach() for name, x in fit.parameters.items()}, fit.shading)


@pytest.fixture(scope="module")
def start(plain):
    sizes = sizes_for_budget(plain.parameters["scales"].exp(), 3000)
    return without_offset(textured(plain, torch.full((3,), 0.5), sizes))


def changed(model, **parameters):
    return replace(model, parameters={**model.parameters, **parameters})


def squared(model, images):
    targets = [images.target(i) for i in range(len(images))]
    return sum(float((model.render(t.camera, t.light).color - t.color).square().sum()) for t in targets)


def oracle(model, images, rates, sparsity, orders):
    """The loop with whole images, torch's Adam and its constant or falling rates."""
    learnt = {name: model.parameters[name].clone().requires_grad_() for name in ("texels", "palette")}
    adam = torch.optim.Adam([{"params": [x]} for x in learnt.values()], eps=1e-15)
    moving = changed(model, **learnt)
    for view, both in zip(orders, rates, strict=True):
        target: Target = images.target(view)
        alone = rasterize(
            *geometry(model.parameters),
            *(target.camera.viewmat, target.camera.K, target.camera.width, target.camera.height),
            texture=Texture(
                torch.zeros(len(model), 3),
                torch.ones(len(model)),
                *(learnt["texels"], model.parameters["sizes"], model.parameters["offsets"]),
            ),
            options=model.shading.options,
        ).color
        image = moving.render(target.camera, target.light).color
        loss = l1_dssim(image, target.color, 0.2) + sparsity * alone.abs().mean()
        for group, rate in zip(adam.param_groups, both, strict=True):
            group["lr"] = rate
        adam.zero_grad()
        loss.backward()
        adam.step()
    return {name: x.detach() for name, x in learnt.items()}


@pytest.mark.parametrize(("final", "sparsity"), [(1.0, 0.0), (1.0, 0.5), (0.1, 0.0)])
def test_it_is_adam_on_texels_and_palette_with_rates_of_their_own(start, images, final, sparsity):
    steps = 6  # all views once
    falls = [final ** (step / steps) for step in range(steps)]
    order = torch.randperm(6, generator=torch.Generator().manual_seed(0)).tolist()[::-1]
    expected = oracle(start, images, [(0.025 * f, 0.01 * f) for f in falls], sparsity, order)
    found = refined(start, images, steps, PAPER, final=final, sparsity=sparsity).parameters
    # D-SSIM of the visible part differs by what its windows do not see beyond the border.
    assert_close(found["palette"], expected["palette"], atol=2e-4, rtol=0)
    error = (found["texels"] - expected["texels"]).abs()
    assert float(error.mean()) < 2e-4
    assert float((found["texels"] - start.parameters["texels"]).abs().mean()) > 100 * float(error.mean())


def test_gradients_of_palette_and_texels_are_those_of_the_definition(start, images):
    camera, target = images.cameras[0], images.target(0)
    p = {name: x.double() if x.is_floating_point() else x for name, x in start.parameters.items()}
    leaves = {name: start.parameters[name].clone().requires_grad_() for name in ("palette", "texels")}
    exact = {name: p[name].clone().requires_grad_() for name in leaves}
    (changed(start, **leaves).render(camera).color - target.color).square().sum().backward()
    a, d, s, b = material(p, start.shading.material).values()
    view = {name: getattr(camera, name).double() for name in ("viewmat", "K")}
    base, gain = shading.blinn_phong_texture(
        *(exact["palette"].expand(len(start), 3), a, d, s, b, p["means"], p["quats"]),
        camera.position.double(),
        facing=start.shading.facing,
    )
    image = reference.rasterize(
        *geometry(p),
        *view.values(),
        *(camera.width, camera.height),
        texture=Texture(base.clamp(0, 1), gain, exact["texels"], p["sizes"], p["offsets"]),
        background=torch.ones(3).double(),
        options=start.shading.options,
    ).color
    (image - target.color.double()).square().sum().backward()
    for name in leaves:
        scale = float(exact[name].grad.abs().max())
        assert_close(leaves[name].grad.double(), exact[name].grad, atol=1e-4 * scale, rtol=1e-3)  # float32


def test_the_texel_map_shows_texels_without_palette_and_light(start, images):
    camera, colors = images.cameras[0], torch.rand(len(start), 3) - 0.5
    place, surfel = owners(start.parameters)
    texels = torch.empty_like(start.parameters["texels"])
    texels[place] = colors[surfel]
    other = changed(start, texels=texels, palette=torch.tensor([0.9, 0.1, 0.2]), ambient=torch.tensor([3.0]))
    shown = rasterize(
        *geometry(start.parameters),
        *(camera.viewmat, camera.K, camera.width, camera.height),
        features=colors,
        options=start.shading.options,
    )
    assert_close(texel_map(other, camera), shown.color, atol=1e-5, rtol=0)


def test_gradients_of_the_texel_map_are_the_weights_of_surfels(start, images):
    camera = images.cameras[0]
    texels = start.parameters["texels"].abs().add(0.1).requires_grad_()
    texel_map(changed(start, texels=texels), camera).abs().mean().backward()
    place, surfel = owners(start.parameters)
    sums = torch.zeros(len(start), 3).index_add_(0, surfel, texels.grad[place])
    weights = rasterize(
        *geometry(start.parameters),
        *(camera.viewmat, camera.K, camera.width, camera.height),
        features=torch.zeros(len(start), 1),
        outputs=("statistics",),
        options=start.shading.options,
    ).statistics.weight_sum
    values = 3 * camera.width * camera.height
    assert_close(sums, (weights / values)[:, None].expand(-1, 3), atol=1e-6, rtol=1e-3)


def test_adam_finds_detail(start, images):
    assert squared(refined(start, images, 120), images) < 0.95 * squared(start, images)


def test_without_a_rate_the_palette_stays(start, images):
    found = refined(start, images, 3)
    assert torch.equal(found.parameters["palette"], start.parameters["palette"])
    assert not torch.equal(found.parameters["texels"], start.parameters["texels"])


def test_the_palette_alone_finds_the_palette_of_the_images(start):
    known = torch.tensor([0.35, 0.55, 0.7])
    views = cameras()
    planes = [changed(start, palette=known).render(view, HEADLIGHT) for view in views]
    images = images_of([torch.cat([r.color.permute(2, 0, 1), r.alpha[None]]) for r in planes], views)
    model = refined(start, images, 200, PAPER, rate=0.0, final=0.02)
    assert torch.equal(model.parameters["texels"], start.parameters["texels"])
    assert_close(model.parameters["palette"], known, atol=0.01, rtol=0)  # images have 8 bits and are clamped


def test_sparsity_moves_what_texels_have_in_common_to_the_palette(start, images):
    shifted = changed(
        start, palette=start.parameters["palette"] - 0.2, texels=start.parameters["texels"] + 0.2
    )
    sizes, palettes = [], []
    for sparsity in (0.0, 3.0):
        found = refined(shifted, images, 120, PAPER, sparsity=sparsity, rate=0.01)
        sizes.append(float(texel_map(found, images.cameras[0]).abs().mean()))
        palettes.append(found.parameters["palette"])
    assert sizes[1] < 0.5 * sizes[0]
    assert (palettes[1] - palettes[0]).mean() > 0.02


def test_the_palette_remains_a_colour(start, images):
    dark = changed(start, palette=torch.full((3,), 0.01), texels=start.parameters["texels"] + 0.8)
    palette = refined(dark, images, 5, PAPER, palette_rate=0.5).parameters["palette"]
    assert ((palette >= 0) & (palette <= 1)).all()


def test_the_paper_recipe_begins_with_the_mean_colour(plain, images):
    keys = replace(PAPER, texels=2000, sweeps=0, iterations=1, has_offset=False)
    fitted = texturize(plain, images, keys)
    still = texturize(plain, images, replace(keys, palette_rate=0.0))
    moved = (fitted.parameters["palette"] - still.parameters["palette"]).abs()
    assert_close(moved, torch.full((3,), 0.01))  # Adam's first step is its rate


def test_numbers_that_are_not_finite_are_reported(start, images):
    model = changed(start, colors=start.parameters["colors"] * torch.nan)
    with pytest.raises(FitError, match="texture: texels: expected finite values"):
        refined(model, images, 2)
