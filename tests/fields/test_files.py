"""What holds for the files of all fields: each is read as it was written, or refused in one sentence."""

import math
from dataclasses import replace

import pytest
import torch
from safetensors.torch import save

from tests.fields.gaussians.samples import sample as gaussians
from tests.fields.palette.test_palette import box
from tests.fields.rewritten import rewritten
from tests.fields.surfels.samples import sample as surfels
from tests.fields.voxels.test_voxels import ball
from texgs.core.errors import ArgumentError
from texgs.fields.files import open_field
from texgs.fields.gaussians.files import read_gaussians, write_gaussians
from texgs.fields.palette.file import read_palette, write_palette
from texgs.fields.surfels.compact import read_compact, write_compact
from texgs.fields.surfels.model_file import read_model, write_model
from texgs.fields.voxels.file import read_voxels, write_voxels

LOSSLESS = {
    "texgs-model": (surfels, write_model, read_model),
    "texgs-gaussians": (gaussians, write_gaussians, read_gaussians),
    "texgs-voxels": (ball, write_voxels, read_voxels),
    "texgs-palette": (box, write_palette, read_palette),
}
FILES = {**LOSSLESS, "texgs-compact": (surfels, write_compact, read_compact)}


@pytest.mark.parametrize("format", FILES)
def test_files_are_known_by_their_header_and_the_same_field_gives_the_same_bytes(tmp_path, format):
    make, write, _ = FILES[format]
    path = write(tmp_path / "new" / "a", make())
    field = open_field(path)
    assert (field.kind, field.metadata) == (make().kind, make().metadata)
    assert write(tmp_path / "b", make()).read_bytes() == path.read_bytes()
    assert write(tmp_path / "c", field).read_bytes() == path.read_bytes(), "nor is anything rounded twice"
    if format in LOSSLESS:
        assert path.stat().st_size == pytest.approx(field.sizes()["stored_total_mib"] * 2**20, abs=4000)


@pytest.mark.parametrize("kept", [0.0, 0.001, 0.1, 0.5, 0.9, 0.999])
@pytest.mark.parametrize("format", FILES)
def test_a_file_cut_anywhere_is_refused(tmp_path, format, kept):
    make, write, read = FILES[format]
    path = write(tmp_path / "m", make())
    data = path.read_bytes()
    path.write_bytes(data[: int(kept * len(data))])
    whole = "cut short or damaged" if format in LOSSLESS else ""
    message = whole if int(kept * len(data)) > 8 else "another format"
    with pytest.raises(ArgumentError, match=f"{path}: expected .*{message}"):
        read(path)


@pytest.mark.parametrize("format", FILES)
def test_files_that_are_no_field_are_named(tmp_path, format):
    read = FILES[format][2]
    with pytest.raises(ArgumentError, match="none: no such file"):
        read(tmp_path / "none")
    with pytest.raises(ArgumentError, match="got a folder"):
        read(tmp_path)
    for content in (b"", b"\x80\x04K\x01.", bytes(100), b'{"a":1}\n'):
        (tmp_path / "m").write_bytes(content)
        with pytest.raises(ArgumentError, match=rf"expected a {format} file, got .*another format|whole"):
            read(tmp_path / "m")
    for header in (None, {"format": "pt"}):
        (tmp_path / "m").write_bytes(save({"weight": torch.zeros(3)}, header))
        with pytest.raises(ArgumentError, match=f"expected a {format} file, got .* of another"):
            read(tmp_path / "m")


@pytest.mark.parametrize(
    ("version", "message"),
    [
        (2, "expected version 1 of the format at most, got 2; update texgs"),
        ("new", "expected JSON with a version"),
        (math.inf, "expected JSON with a version"),
    ],
)
@pytest.mark.parametrize("format", LOSSLESS)
def test_a_version_that_cannot_be_read_is_named(tmp_path, format, version, message):
    make, write, read = FILES[format]
    path = rewritten(write(tmp_path / "m", make()), format, version=version)
    with pytest.raises(ArgumentError, match=f"{path}: {message}"):
        read(path)


@pytest.mark.parametrize("format", FILES)
def test_what_could_not_be_read_back_is_not_written(tmp_path, format):
    make, write, _ = FILES[format]
    path = write(tmp_path / "m", make())
    before = path.read_bytes()
    for bad in (torch.nan, path):
        with pytest.raises(ArgumentError, match="metadata cannot be written as JSON"):
            write(path, replace(make(), metadata={"x": bad}))
    if hasattr(make(), "shading"):
        broken = {**make().parameters, "opacities": torch.full((7,), torch.inf)}
        with pytest.raises(ArgumentError, match=f"{path}: opacities: .* got 0 NaN and 7 infinite"):
            write(path, replace(make(), parameters=broken))
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]
