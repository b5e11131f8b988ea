import json
import struct
from contextlib import suppress
from dataclasses import replace

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from safetensors.torch import load, save

from tests.fields.gaussians.samples import sample
from tests.fields.surfels.samples import same
from tests.fields.surfels.samples import sample as surfels
from texgs.core.errors import ArgumentError, ShapeError, TexgsError
from texgs.fields.files import open_field
from texgs.fields.gaussians.model_file import FORMAT, read_gaussians, write_gaussians
from texgs.fields.surfels.model_file import write_model


def rewritten(path, tensors=None, **description):
    """A valid file, some tensors (None removes one) and entries of its description changed."""
    data = write_gaussians(path, sample()).read_bytes()
    length = struct.unpack("<Q", data[:8])[0]
    header = json.loads(json.loads(data[8 : 8 + length])["__metadata__"][FORMAT])
    kept = {name: x for name, x in {**load(data), **(tensors or {})}.items() if x is not None}
    path.write_bytes(save(kept, {FORMAT: json.dumps({**header, **description})}))
    return path


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
@pytest.mark.parametrize("n", [0, 7])
def test_round_trip_is_exact(tmp_path, degree, n):
    model = sample(n, degree=degree, antialiased=degree == 2)
    field = open_field(write_gaussians(tmp_path / "new" / "model.safetensors", model))
    assert same(field, model)
    assert (field.kind, field.shading, field.metadata) == ("gaussians", model.shading, model.metadata)


def test_the_same_model_gives_the_same_bytes(tmp_path):
    first = write_gaussians(tmp_path / "a", sample()).read_bytes()
    assert write_gaussians(tmp_path / "b", sample()).read_bytes() == first


def test_other_programs_can_read_the_tensors(tmp_path):
    data = write_gaussians(tmp_path / "m", sample(antialiased=True)).read_bytes()
    assert torch.equal(load(data)["sh"], sample().parameters["sh"])
    length = struct.unpack("<Q", data[:8])[0]
    description = json.loads(json.loads(data[8 : 8 + length])["__metadata__"]["texgs-gaussians"])
    assert description == {"version": 1, "filter": {"antialiased": True}, "metadata": sample().metadata}


@pytest.mark.parametrize("kept", [0.0, 0.01, 0.1, 0.5, 0.999])
def test_a_file_cut_anywhere_is_refused(tmp_path, kept):
    path = write_gaussians(tmp_path / "m", sample())
    data = path.read_bytes()
    path.write_bytes(data[: int(kept * len(data))])
    with pytest.raises(ArgumentError, match="cut short or damaged" if kept else "of another format"):
        read_gaussians(path)


@settings(max_examples=100, deadline=None)
@given(
    changes=st.lists(
        st.tuples(st.floats(0, 1, exclude_max=True), st.integers(0, 255)), min_size=1, max_size=4
    )
)
def test_a_changed_byte_gives_a_model_or_a_sentence(tmp_path_factory, changes):
    path = write_gaussians(tmp_path_factory.mktemp("m") / "m", sample(n=2))
    data = bytearray(path.read_bytes())
    for place, value in changes:
        data[int(place * len(data))] = value
    path.write_bytes(data)
    with suppress(TexgsError):
        read_gaussians(path)


def test_files_that_are_no_gaussians_are_named(tmp_path):
    with pytest.raises(ArgumentError, match="none: no such file"):
        read_gaussians(tmp_path / "none")
    with pytest.raises(ArgumentError, match="expected a texgs-gaussians file, got safetensors of another"):
        read_gaussians(write_model(tmp_path / "surfels", surfels()))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"version": 2}, "expected version 1 of the format at most, got 2; update texgs"),
        ({"version": "new"}, "expected JSON with a version"),
        ({"filter": {"antialiased": 1}}, "expected filter and metadata in the header"),
        ({"filter": {"lens": 1}}, "expected filter and metadata in the header"),
        ({"filter": []}, "expected filter and metadata in the header"),
        ({"metadata": 3}, "expected filter and metadata in the header"),
    ],
)
def test_a_header_that_cannot_be_used_is_named(tmp_path, change, message):
    with pytest.raises(ArgumentError, match=message) as raised:
        read_gaussians(rewritten(tmp_path / "m", **change))
    assert str(raised.value).startswith(f"{tmp_path / 'm'}: ")


@pytest.mark.parametrize(
    ("tensors", "message"),
    [
        ({"means": None}, "expected means, quats, scales, opacities, sh, got"),
        ({"mood": torch.zeros(3)}, "expected means, quats, scales, opacities, sh, got"),
        ({"quats": torch.zeros(6, 4)}, r"quats: expected \[7, 4\], got \[6, 4\]"),
        ({"means": torch.zeros(7, 3).double()}, r"means: expected torch.float32, got torch.float64"),
        ({"scales": torch.full((7, 3), torch.nan)}, "scales: expected finite values, got 21 NaN"),
    ],
)
def test_a_tensor_that_cannot_be_used_is_named(tmp_path, tensors, message):
    with pytest.raises((ArgumentError, ShapeError), match=message) as raised:
        read_gaussians(rewritten(tmp_path / "m", tensors))
    assert str(raised.value).startswith(f"{tmp_path / 'm'}: ")


def test_what_could_not_be_read_back_is_not_written(tmp_path):
    path, model = tmp_path / "m", sample()
    before = write_gaussians(path, model).read_bytes()
    broken = {**model.parameters, "opacities": torch.full((7,), torch.inf)}
    for bad, message in (
        (replace(model, metadata={"x": torch.nan}), "metadata cannot be written as JSON"),
        (replace(model, parameters=broken), "opacities: expected finite values, got 0 NaN and 7 infinite"),
    ):
        with pytest.raises(ArgumentError, match=message):
            write_gaussians(path, bad)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]
