import pytest
import torch
from safetensors.torch import load_file

from tests.fields.rewritten import rewritten
from tests.fields.surfels.samples import same, sample
from tests.refusals import refused
from texgs.core.errors import TexgsError
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.texels import mean_texels, owners
from texgs.fields.surfels.variants import FORMAT, with_texture, write_texture


def restyled(model):
    """The model with other texels and colours."""
    p = model.parameters
    return Surfels({**p, "texels": p["texels"] + 0.5, "colors": -p["colors"]}, model.shading, model.metadata)


def test_a_variant_brings_texels_and_colours_and_nothing_else(tmp_path):
    model = sample()
    path = write_texture(tmp_path / "style.safetensors", restyled(model), {"style": "half"})
    assert same(with_texture(model, path), restyled(model))
    assert set(load_file(path)) == {"texels", "colors", "sizes"}


def test_texels_belong_to_their_surfels_in_whatever_order_they_lie(tmp_path):
    model = sample()
    p, order = model.parameters, torch.randperm(len(model), generator=torch.Generator().manual_seed(0))
    counts = p["sizes"].long().prod(1)
    offsets, place = torch.zeros_like(p["offsets"]), 3  # with a gap before each
    for surfel in order.tolist():
        offsets[surfel], place = place, place + int(counts[surfel]) + 1
    texels = torch.zeros(place, 3)
    moved = Surfels({**p, "offsets": offsets, "texels": texels}, model.shading, model.metadata)
    texels[owners(moved.parameters)[0]] = p["texels"][owners(p)[0]]
    path = write_texture(tmp_path / "a", restyled(moved))
    assert same(with_texture(model, path), restyled(model))
    back = with_texture(moved, write_texture(tmp_path / "b", restyled(model)))
    torch.testing.assert_close(mean_texels(back.parameters), mean_texels(restyled(model).parameters))


def test_a_file_without_colours_keeps_those_of_the_model(tmp_path):
    model = sample()
    path = rewritten(write_texture(tmp_path / "style.safetensors", restyled(model)), FORMAT, {"colors": None})
    parameters = with_texture(model, path).parameters
    assert torch.equal(parameters["colors"], model.parameters["colors"])
    assert torch.equal(parameters["texels"], model.parameters["texels"] + 0.5)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("colors", torch.zeros(3, 3)),
        ("colors", torch.full((7, 3), torch.nan)),
        ("sizes", torch.ones(4, 2, dtype=torch.int32)),
        ("sizes", sample().parameters["sizes"].long()),
        ("texels", sample().parameters["texels"].double()),
    ],
)
def test_tensors_of_another_model_are_refused(tmp_path, name, value):
    model = sample()
    path = rewritten(write_texture(tmp_path / "style", restyled(model)), FORMAT, {name: value})
    refused(lambda: with_texture(model, path), f"{path}: .*{name}", TexgsError)
