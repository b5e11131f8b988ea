import json
import math
import struct
from contextlib import suppress
from dataclasses import replace

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from safetensors.torch import load, save

from tests.fields.surfels.samples import STAGES, same, sample
from texgs.core.errors import ArgumentError, ShapeError, TexgsError
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.model_file import FORMAT, read_model, write_model


def rewritten(path, tensors=None, **description):
    """A valid file, some tensors (None removes one) and entries of its description changed."""
    model = sample()
    write_model(path, model)
    data = path.read_bytes()
    length = struct.unpack("<Q", data[:8])[0]
    header = json.loads(json.loads(data[8 : 8 + length])["__metadata__"][FORMAT])
    kept = {name: x for name, x in {**load(data), **(tensors or {})}.items() if x is not None}
    path.write_bytes(save(kept, {FORMAT: json.dumps({**header, **description})}))
    return path


@pytest.mark.parametrize("stage", STAGES)
@pytest.mark.parametrize("shared", [False, True])
def test_round_trip_is_exact(tmp_path, stage, shared):
    model = sample(stage, shared=shared, low_pass=2.5, material="paper", local_viewer=False)
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


def test_no_surfels_are_a_model(tmp_path):
    model = sample(n=0)
    assert same(read_model(write_model(tmp_path / "m", model)), model)


def test_the_same_model_gives_the_same_bytes(tmp_path):
    first = write_model(tmp_path / "a", sample()).read_bytes()
    assert write_model(tmp_path / "b", sample()).read_bytes() == first


def test_views_of_one_memory_and_gradients_are_written(tmp_path):
    model = sample("shading")
    twice = torch.randn(7, 6, requires_grad=True)
    model = Surfels({**model.parameters, "means": twice[:, ::2], "colors": twice[:, ::2]})
    restored = read_model(write_model(tmp_path / "m", model))
    assert torch.equal(restored.parameters["means"], twice[:, ::2])
    assert not restored.parameters["colors"].requires_grad


def test_other_programs_can_read_the_tensors(tmp_path):
    """The format is public: safetensors with plain names, and JSON under one key of the header."""
    data = write_model(tmp_path / "m", sample(low_pass=3.0)).read_bytes()
    assert torch.equal(load(data)["texels"], sample().parameters["texels"])
    length = struct.unpack("<Q", data[:8])[0]
    description = json.loads(json.loads(data[8 : 8 + length])["__metadata__"]["texgs-model"])
    assert description == {
        "version": 1,
        "stage": "texture",
        "optics": {"low_pass": 3.0, "material": "bounded", "local_viewer": True, "facing": True},
        "metadata": sample().metadata,
    }


@pytest.mark.parametrize("kept", [0.0, 0.001, 0.1, 0.5, 0.9, 0.999])
def test_a_file_cut_anywhere_is_refused(tmp_path, kept):
    path = write_model(tmp_path / "m", sample())
    data = path.read_bytes()
    path.write_bytes(data[: int(kept * len(data))])
    with pytest.raises(ArgumentError, match="cut short or damaged" if kept > 0.01 else "of another format"):
        read_model(path)


@settings(max_examples=100, deadline=None)
@given(
    changes=st.lists(
        st.tuples(st.floats(0, 1, exclude_max=True), st.integers(0, 255)), min_size=1, max_size=4
    )
)
def test_a_changed_byte_gives_a_model_or_a_sentence(tmp_path_factory, changes):
    path = write_model(tmp_path_factory.mktemp("m") / "m", sample(n=2))
    data = bytearray(path.read_bytes())
    for place, value in changes:
        data[int(place * len(data))] = value
    path.write_bytes(data)
    with suppress(TexgsError):
        read_model(path)


def test_files_that_are_no_model_are_named(tmp_path):
    with pytest.raises(ArgumentError, match="none: no such file"):
        read_model(tmp_path / "none")
    with pytest.raises(ArgumentError, match="got a folder"):
        read_model(tmp_path)
    path = tmp_path / "m"
    for content in (b"ply\nformat ascii 1.0\nend_header\n", b"\x80\x04K\x01.", bytes(100)):
        path.write_bytes(content)
        with pytest.raises(ArgumentError, match="expected a texgs-model file, got one of another format"):
            read_model(path)
    for header in (None, {"format": "pt"}):
        path.write_bytes(save({"weight": torch.zeros(3)}, header))
        with pytest.raises(ArgumentError, match="got safetensors of another program"):
            read_model(path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"version": 2}, "expected version 1 of the format at most, got 2; update texgs"),
        ({"version": "new"}, "expected JSON with a version"),
        ({"version": math.inf}, "expected JSON with a version"),
        ({"stage": "cooked"}, "expected stage surfels, shading, texture, got 'cooked'"),
        ({"stage": []}, "expected stage surfels, shading, texture"),
        (
            {"optics": {"low_pass": 2.0, "lens": 1}},
            "expected stage, optics and metadata in the header",
        ),
        ({"optics": {"material": "wood"}}, "optics: expected values"),
        ({"optics": {"low_pass": -1}}, "optics: expected values"),
        ({"optics": {"low_pass": "thin"}}, "expected stage, optics and metadata in the header"),
        ({"metadata": 3}, "expected stage, optics and metadata in the header"),
    ],
)
def test_a_header_that_cannot_be_used_is_named(tmp_path, change, message):
    with pytest.raises(ArgumentError, match=message) as raised:
        read_model(rewritten(tmp_path / "m", **change))
    assert str(raised.value).startswith(f"{tmp_path / 'm'}: ")


@pytest.mark.parametrize(
    ("tensors", "message"),
    [
        ({"means": None}, "expected means, quats, scales, opacities"),
        ({"texels": None}, "expected tensor texels at stage texture, got"),
        ({"ambient": None}, "expected tensor ambient at stage texture"),
        ({"colors": None, "sh": torch.zeros(7, 1, 3)}, "expected tensor colors at stage texture"),
        ({"mood": torch.zeros(3)}, "expected tensors of a texgs model, got mood"),
        ({"quats": torch.zeros(6, 4)}, r"quats: expected \[7, 4\], got \[6, 4\]"),
        ({"diffuse": torch.zeros(2)}, r"diffuse: expected \[7\] or \[1\], got \[2\]"),
        ({"means": torch.zeros(7, 3).double()}, r"means: expected torch.float32, got torch.float64"),
        ({"sizes": torch.ones(7, 2).long()}, r"sizes: expected torch.int32"),
        ({"scales": torch.full((7, 2), torch.nan)}, "scales: expected finite values, got 14 NaN"),
        ({"offsets": torch.arange(7) + 1000}, "textures within the"),
        ({"offsets": torch.zeros(7).long()}, "texels of its own for every surfel"),
    ],
)
def test_a_tensor_that_cannot_be_used_is_named(tmp_path, tensors, message):
    with pytest.raises((ArgumentError, ShapeError), match=message) as raised:
        read_model(rewritten(tmp_path / "m", tensors))
    assert str(raised.value).startswith(f"{tmp_path / 'm'}: ")


def test_what_could_not_be_read_back_is_not_written(tmp_path):
    path, model = tmp_path / "m", sample()
    write_model(path, model)
    before = path.read_bytes()
    broken = {**model.parameters, "opacities": torch.full((7,), torch.inf)}
    for bad, message in (
        (replace(model, metadata={"x": torch.nan}), "metadata cannot be written as JSON"),
        (replace(model, metadata={"x": path}), "metadata cannot be written as JSON"),
        (replace(model, parameters=broken), "opacities: expected finite values, got 0 NaN and 7 infinite"),
    ):
        with pytest.raises(ArgumentError, match=message):
            write_model(path, bad)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]
