import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from safetensors.torch import load_file

from tests.fields.rewritten import description_of
from tests.fields.surfels.samples import STAGES, same, sample
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.model_file import read_model, write_model


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
