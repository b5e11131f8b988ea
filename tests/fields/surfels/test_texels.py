"""Texels of surfels: their shares, their means, and models with no more of them than they need."""

from dataclasses import replace

import pytest
import torch

from tests.fields.gaussians.samples import sample as gaussians
from tests.fields.surfels.samples import sample
from texgs.core.camera import orbit
from texgs.fields.surfels.texels import (
    footprint,
    owners,
    reduce_constant_textures,
    spread_colors,
    with_single_texels,
)

CAMERA = orbit(30, 20, 4, 40, 48, 48)


def test_shares_are_those_of_the_gaussian_over_six_deviations():
    shares = footprint(torch.tensor([[3, 1], [1, 1]]))
    side = torch.exp(torch.tensor(-2.0))  # two deviations from the middle
    expected = torch.tensor([side, 1.0, side]) / (1 + 2 * side)
    torch.testing.assert_close(shares, torch.cat([expected, torch.ones(1)]))


def test_without_texture_each_surfel_has_the_mean_under_its_gaussian():
    model = sample("texture", n=20)
    p, plain = model.parameters, with_single_texels(model)
    assert len(plain.parameters["texels"]) == 20
    spread_out = spread_colors(plain.parameters["texels"], plain, model)
    place, surfel = owners(p)
    for index in range(20):
        own = place[surfel == index]
        weights = footprint(p["sizes"][index : index + 1]).double()
        mean = (weights[:, None] * p["texels"][own].double()).sum(0)
        torch.testing.assert_close(spread_out[own].double(), mean.expand(len(own), 3), atol=1e-6, rtol=0)


def test_a_lean_model_looks_the_same_with_a_texel_for_each_plain_surfel():
    model = sample("texture", n=60)
    plain = torch.arange(60) % 3 > 0
    p, small = model.parameters, with_single_texels(model, plain)
    place, surfel = owners(p)
    texels = spread_colors(small.parameters["texels"], small, model)
    texels[place] = torch.where(plain[surfel, None], texels[place], p["texels"][place])
    mixed = replace(model, parameters={**p, "texels": texels})
    assert torch.equal(reduce_constant_textures(mixed).parameters["texels"], small.parameters["texels"])
    counts = p["sizes"].long().prod(1)
    assert len(small.parameters["texels"]) == int(torch.where(plain, 1, counts).sum())
    torch.testing.assert_close(small.render(CAMERA).color, mixed.render(CAMERA).color, atol=1e-6, rtol=0)
    assert small.sizes()["files_mib"] < mixed.sizes()["files_mib"]


@pytest.mark.parametrize("model", [sample("texture", n=9), sample("shading", n=9), gaussians(5)])
def test_what_has_nothing_to_spare_stays_as_it_is(model):
    assert len(reduce_constant_textures(model)) == len(model)
    for name, x in model.tensors("appearance").items() if hasattr(model, "tensors") else ():
        assert torch.equal(reduce_constant_textures(model).tensors("appearance")[name], x)
