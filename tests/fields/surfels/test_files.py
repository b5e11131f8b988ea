"""Files of surfels: whole models, textures that replace those of one, and steps of a series."""

from dataclasses import replace

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from safetensors.torch import load_file

from tests.fields.rewritten import description_of, rewritten
from tests.fields.surfels.samples import STAGES, same, sample
from tests.refusals import refused
from texgs.core.errors import TexgsError
from texgs.core.geometry import quats_to_matrices
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.model_file import read_model, write_model
from texgs.fields.surfels.step_file import FORMAT as STEP
from texgs.fields.surfels.step_file import TURNING_TENSORS, UNITS, at_step, write_step
from texgs.fields.surfels.texels import mean_texels, owners
from texgs.fields.surfels.variants import FORMAT, with_texture, write_texture


@pytest.mark.parametrize("stage", STAGES)
@pytest.mark.parametrize("shared", [False, True])
@pytest.mark.parametrize("n", [0, 7])
def test_round_trip_is_exact(tmp_path, stage, shared, n):
    model = sample(stage, n, shared=shared, low_pass=2.5, material="paper", local_viewer=False)
    restored = read_model(write_model(tmp_path / "new" / "model.safetensors", model))
    assert same(restored, model)
    assert (restored.stage, restored.shading, restored.metadata) == (stage, model.shading, model.metadata)


@settings(max_examples=30, deadline=None)
@given(
    values=st.lists(st.floats(width=32, allow_nan=False, allow_infinity=False), min_size=3, max_size=3),
    metadata=st.dictionaries(
        st.text(), st.none() | st.integers() | st.floats(allow_nan=False, allow_infinity=False)
    ),
)
def test_any_finite_value_and_any_metadata_come_back(tmp_path_factory, values, metadata):
    model = sample("shading", n=1)
    model = Surfels({**model.parameters, "means": torch.tensor([values])}, model.shading, metadata)
    restored = read_model(write_model(tmp_path_factory.mktemp("m") / "m", model))
    assert same(restored, model)
    assert restored.metadata == metadata


def test_views_of_one_memory_and_gradients_are_written(tmp_path):
    model = sample("shading")
    twice = torch.randn(7, 6, requires_grad=True)
    model = Surfels({**model.parameters, "means": twice[:, ::2], "colors": twice[:, ::2]})
    restored = read_model(write_model(tmp_path / "m", model))
    assert torch.equal(restored.parameters["means"], twice[:, ::2])
    assert not restored.parameters["colors"].requires_grad


def test_other_programs_can_read_the_tensors(tmp_path):
    """The format is public: safetensors with plain names, and JSON under one key of the header."""
    path = write_model(tmp_path / "m", sample(low_pass=3.0))
    assert torch.equal(load_file(path)["texels"], sample().parameters["texels"])
    assert description_of(path, "texgs-model") == {
        "version": 1,
        "stage": "texture",
        "optics": {"low_pass": 3.0, "material": "bounded", "local_viewer": True, "facing": True},
        "metadata": sample().metadata,
    }


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


TEXTURE = ("texels", "sizes", "offsets", "palette", "ambient")


def moved(model, seed=1):
    """The model with its surfels elsewhere."""
    generator = torch.Generator().manual_seed(seed)
    p = {
        name: x + 0.2 * torch.randn(x.shape, generator=generator)
        for name, x in model.parameters.items()
        if name in UNITS
    }
    p["quats"] = -3 * p["quats"]  # of another length and sign, the same rotation
    return replace(model, parameters={**model.parameters, **p})


def test_a_step_comes_back_up_to_half_a_unit_and_the_rest_is_the_key_model(tmp_path):
    key = sample()
    key.parameters["normals"] = key.parameters["quats"].flip(1)
    step = moved(key)
    back = at_step(key, write_step(tmp_path / "s", key, step, {"file": "v"})).parameters
    for name in UNITS.keys() & back.keys():
        if name not in TURNING_TENSORS:
            torch.testing.assert_close(back[name], step.parameters[name], atol=0.51 * UNITS[name], rtol=1e-6)
    for name in TURNING_TENSORS:
        turned = (quats_to_matrices(x) for x in (back[name], step.parameters[name]))
        torch.testing.assert_close(*turned, atol=1e-3, rtol=0)
    assert all(back[name] is key.parameters[name] for name in TEXTURE)


def test_what_is_read_and_written_again_is_the_same(tmp_path):
    key = sample()
    once = at_step(key, write_step(tmp_path / "s", key, moved(key), {}))
    again = at_step(key, write_step(tmp_path / "t", key, once, {}))
    assert all(
        torch.equal(x, again.parameters[name]) for name, x in once.parameters.items() if name != "quats"
    )
    torch.testing.assert_close(
        once.parameters["quats"], again.parameters["quats"], atol=2 * UNITS["quats"], rtol=0
    )


def test_a_surfel_has_26_bytes(tmp_path):
    sizes = [
        write_step(tmp_path / "s", key, moved(key), {}).stat().st_size
        for key in (sample(n=100), sample(n=1100))
    ]
    assert sizes[1] - sizes[0] == pytest.approx(26_000, abs=100)


def test_a_difference_that_is_too_large_ends_at_the_largest(tmp_path):
    key = sample()
    far = replace(key, parameters={**key.parameters, "opacities": key.parameters["opacities"] - 1e5})
    back = at_step(key, write_step(tmp_path / "s", key, far, {}))
    assert bool((back.parameters["opacities"] < -25).all())


@pytest.mark.parametrize(
    ("name", "value"),
    [("means", None), ("means", torch.zeros(6, 3, dtype=torch.int16)), ("colors", torch.zeros(7, 3))],
)
def test_a_step_of_another_model_is_refused(tmp_path, name, value):
    key = sample()
    path = write_step(tmp_path / "step", key, moved(key), {})
    refused(lambda: at_step(sample(seed=5), path), f"{path}: .*of another", TexgsError)
    rewritten(path, STEP, {name: value})
    refused(lambda: at_step(key, path), f"{path}: .*7 surfels", TexgsError)


def test_a_step_that_is_no_model_of_the_series_is_not_written(tmp_path):
    key, early = sample(), sample("surfels")
    torn = {**key.parameters, "means": torch.full((7, 3), torch.nan)}
    for model, step, named in (
        (key, replace(key, parameters=torn), "means: .*finite"),
        (key, sample(n=8), "means: "),
        (early, early, "got surfels"),
    ):
        refused(lambda m=model, s=step: write_step(tmp_path / "s", m, s, {}), named, TexgsError)
    assert not (tmp_path / "s").exists()
