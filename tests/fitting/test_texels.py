"""Layout of textures, and what the phase changes and what it leaves alone."""

import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch.testing import assert_close

from tests.fitting.scenes import (
    ball_images,
    ball_seeds,
    blank_images,
    cameras,
    images_of,
    model_of,
    new_fit,
    run,
)  # fmt: skip
from tests.refusals import refused
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import ShadingModel, in_full_light, material, raw_material
from texgs.fields.surfels.texels import offsets_of
from texgs.fitting.colors import mean_color
from texgs.fitting.settings import TextureKeys
from texgs.fitting.texels import (
    Sight,
    add_texture,
    gather_sight,
    sizes_for_budget,
    sizes_where_seen,
    texturize,
)
from texgs.raster.arguments import check_texture
from texgs.raster.types import Texture


@pytest.fixture(scope="module")
def images():
    return ball_images()


@pytest.fixture(scope="module")
def ball(images):
    return model_of(run(new_fit(images, iterations=60)))


def total(sizes):
    return int(sizes.long().prod(dim=1).sum())


def sight(largest, pixel):
    return Sight(torch.tensor(largest), torch.tensor(pixel), *torch.ones(2, len(largest)))


def test_sizes_follow_the_formula_with_the_smallest_edge_that_keeps_the_budget():
    scales = [[0.1, 0.2], [0.05, 0.01], [1e-6, 1e-6]]

    def sizes(edge):
        return [[math.ceil(6 * u / edge), math.ceil(6 * v / edge)] for u, v in scales]

    edges = (1e-3 * k for k in range(10, 1000))
    edge = next(edge for edge in edges if sum(u * v for u, v in sizes(edge)) <= 1000)
    assert sizes_for_budget(torch.tensor(scales), 1000).tolist() == sizes(edge)
    assert sizes(edge)[2] == [1, 1]


@given(st.integers(60, 300_000), st.integers(0, 5))
def test_a_budget_is_never_exceeded_and_used_to_a_row_of_a_surfel(budget, seed):
    scales = torch.rand(50, 2, generator=torch.Generator().manual_seed(seed)) * 0.1 + 0.02
    sizes = sizes_for_budget(scales, budget)
    assert budget - int(sizes.max()) <= total(sizes) <= budget


def test_each_surfel_has_a_texel_whatever_the_budget():
    assert sizes_for_budget(torch.rand(50, 2), 7).tolist() == [[1, 1]] * 50


def test_a_texel_is_a_pixel_where_a_surfel_is_fully_seen():
    scales = torch.full((4, 2), 0.1)
    sizes = sizes_where_seen(scales, sight([1.0, 0.25, 0.0, 1.0], [0.061, 0.061, math.inf, 0.0301]))
    assert sizes.tolist() == [[10, 10], [5, 5], [1, 1], [20, 20]]


def test_textures_lie_one_after_the_other():
    sizes = torch.tensor([[2, 3], [1, 1], [4, 2]], dtype=torch.int32)
    offsets = offsets_of(sizes)
    assert offsets.tolist() == [0, 6, 7]
    check_texture(Texture(torch.zeros(3, 3), torch.ones(3), torch.zeros(15, 3), sizes, offsets), 3)


def test_look_sees_the_size_of_pixels_and_what_is_hidden():
    p = ball_seeds(count=20)
    p["means"] = torch.zeros(20, 3)
    p["opacities"] = torch.full((20,), 8.0)
    p["means"][0] = torch.tensor([0.0, 50.0, 0.0])  # in no view
    views = cameras()
    seen = gather_sight(
        add_texture(Surfels(p, ShadingModel()), torch.zeros(3), torch.ones(20, 2, dtype=torch.int32)),
        ball_images(),
        "",
    )
    assert seen.largest[0] == 0
    assert seen.pixel[0] == math.inf
    expected = torch.tensor(min(float(v.position.norm() / v.K[0, 0]) for v in views))
    assert_close(seen.pixel[seen.largest > 0], expected.expand(int((seen.largest > 0).sum())))
    assert (seen.curvature[seen.largest > 0] > 0).all()


def test_mean_color_counts_what_is_there_only():
    planes = [torch.ones(4, 8, 8) for _ in range(2)]
    planes[0][3] = 0  # white behind nothing
    planes[1][:3, :, :4] = torch.tensor([0.2, 0.4, 0.6])[:, None, None]
    planes[1][3, :, 4:] = 0
    assert_close(mean_color(images_of(planes, cameras(2, 8))), torch.tensor([0.2, 0.4, 0.6]))
    assert mean_color(blank_images()).tolist() == [0, 0, 0], "of nothing it is finite"


def test_an_empty_texture_renders_as_before(ball, images):
    p = {**ball.parameters, "colors": ball.parameters["colors"] * 1.5 - 0.2}
    plain = Surfels(p, ball.shading)
    with_texels = texturize(plain, images, TextureKeys(sweeps=0))
    assert with_texels.stage == "texture"
    for view in cameras():
        assert_close(with_texels.render(view).color, plain.render(view).color, atol=1e-6, rtol=0)


def test_texels_can_take_the_colors_over(ball, images):
    with_offset = texturize(ball, images, TextureKeys(2000, sweeps=0))
    without = texturize(ball, images, TextureKeys(2000, sweeps=0, has_offset=False))
    assert not without.parameters["colors"].any()
    p = with_offset.parameters
    for surfel, offset in enumerate(p["offsets"].tolist()):
        own = slice(offset, offset + int(p["sizes"][surfel].prod()))
        taken = without.parameters["palette"] + without.parameters["texels"][own]
        assert_close(taken, p["palette"] + p["texels"][own] + p["colors"][surfel])


def test_all_else_stays(ball, images):
    fitted = texturize(ball, images, TextureKeys(sweeps=1, iterations=2))
    for name in ("means", "quats", "scales", "opacities", "ambient", "diffuse", "specular", "shininess"):
        assert fitted.parameters[name] is ball.parameters[name]
    assert_close(fitted.parameters["colors"] + fitted.parameters["palette"], ball.parameters["colors"])


def test_same_seed_same_texels(ball, images):
    keys = TextureKeys(sweeps=1, iterations=3)
    first, second, other = (texturize(ball, images, keys, seed) for seed in (1, 1, 2))
    assert torch.equal(first.parameters["texels"], second.parameters["texels"])
    assert not torch.equal(first.parameters["texels"], other.parameters["texels"])


def test_models_of_another_stage_and_budgets_that_cannot_be_had(ball, images):
    p = {name: ball.parameters[name] for name in ("means", "quats", "scales", "opacities")}
    early = Surfels({**p, "sh": torch.zeros(len(ball), 1, 3)})
    late = texturize(ball, images, TextureKeys(sweeps=0))
    refused(lambda: texturize(early, images, TextureKeys()), "stage shading, got surfels")
    refused(lambda: texturize(late, images, TextureKeys()), "stage shading, got texture")
    for texels in (0, 2**25):
        refused(lambda texels=texels: sizes_for_budget(torch.tensor([[1.0, 1.0]]), texels), "texels: ")


@pytest.mark.parametrize("rows", [1, None])
def test_colours_in_full_light_are_those_that_a_volume_has(ball, rows):
    """A ball of one colour under k_a + k_d = 0.5 has half of it; its palette is then the colour itself."""
    n, color = len(ball), torch.tensor([0.2, 0.3, 0.4])
    dim = {name: x.repeat(rows or n) for name, x in raw_material(0.2, 0.3, 0.1, 20.0, "bounded").items()}
    model = Surfels({**ball.parameters, **dim, "colors": 2 * color.repeat(n, 1)}, ball.shading)
    scaled = Surfels(in_full_light(model.parameters, "bounded"), ball.shading)
    factors = material(scaled.parameters, "bounded")
    assert_close(factors["ambient"] / factors["diffuse"], torch.full((rows or n,), 2 / 3))
    for view in cameras():
        assert_close(scaled.render(view).color, model.render(view).color, atol=1e-5, rtol=0)
    assert_close(scaled.parameters["colors"], color.repeat(n, 1))


def test_a_palette_is_the_colour_without_light(ball, images):
    n, color = len(ball), torch.tensor([0.2, 0.3, 0.4])
    plain = Surfels({**ball.parameters, "colors": color.repeat(n, 1)}, ball.shading)
    assert_close(texturize(plain, images, TextureKeys(2000, sweeps=0)).parameters["palette"], color)
    of_views = texturize(plain, images, TextureKeys(2000, sweeps=0, has_offset=False)).parameters["palette"]
    assert_close(of_views, mean_color(images))  # as in the paper


def test_materials_without_ranges_of_light_stay(ball):
    paper = {**ball.parameters, **raw_material(1.0, 0.5, 2.5, 36.0, "paper")}
    assert in_full_light(paper, "paper") == paper
