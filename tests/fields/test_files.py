"""What holds for the files of all fields: each is read as it was written, or refused in one sentence."""

import math
from dataclasses import replace
from functools import partial

import pytest
import torch
from safetensors.torch import save

from tests.fields.gaussians.samples import sample as gaussians
from tests.fields.palette.test_palette import box
from tests.fields.rewritten import rewritten
from tests.fields.surfels.samples import sample as surfels
from tests.fields.voxels.test_voxels import ball
from tests.refusals import refused
from texgs.core.errors import TexgsError
from texgs.fields.files import open_field
from texgs.fields.gaussians import read_gaussians, write_gaussians
from texgs.fields.palette.model import read_palette, write_palette
from texgs.fields.surfels.compact import read_compact, write_compact
from texgs.fields.surfels.model_file import read_model, write_model
from texgs.fields.voxels import read_voxels, write_voxels

LOSSLESS = {
    "texgs-model": (surfels, write_model, read_model),
    "texgs-gaussians": (gaussians, write_gaussians, read_gaussians),
    "texgs-voxels": (ball, write_voxels, read_voxels),
    "texgs-palette": (partial(box, scale=1.0, free=True), write_palette, read_palette),
}
FILES = {**LOSSLESS, "texgs-compact": (surfels, write_compact, read_compact)}


@pytest.mark.parametrize("format", FILES)
def test_files_are_known_by_their_header_and_the_same_field_gives_the_same_bytes(tmp_path, format):
    make, write, _ = FILES[format]
    path = write(tmp_path / "new" / "a", make())
    field = open_field(path)
    assert (field.kind, field.metadata) == (make().kind, make().metadata)
    assert write(tmp_path / "b", make()).read_bytes() == path.read_bytes()
    assert write(tmp_path / "c", field).read_bytes() == path.read_bytes(), "nothing is rounded twice"
    if format in LOSSLESS:
        assert path.stat().st_size == pytest.approx(field.sizes()["stored_total_mib"] * 2**20, abs=4000)


@pytest.mark.parametrize("format", FILES)
def test_files_that_are_no_field_or_cut_are_named(tmp_path, format):
    make, write, read = FILES[format]
    refused(lambda: read(tmp_path / "none"), "none: no such file")
    refused(lambda: read(tmp_path), "got a folder")
    path = write(tmp_path / "m", make())
    data = path.read_bytes()
    for kept in (0.0, 0.001, 0.1, 0.5, 0.9, 0.999):
        path.write_bytes(data[: int(kept * len(data))])
        refused(lambda: read(path), f"{path}: expected ")
    foreign = (save({"weight": torch.zeros(3)}, header) for header in (None, {"format": "pt"}))
    for content in (b"\x80\x04K\x01.", bytes(100), b'{"a":1}\n', *foreign):
        path.write_bytes(content)
        refused(lambda: read(path), f"expected a {format} file, got .*another|whole")


@pytest.mark.parametrize(
    ("version", "named"), [(2, "got 2; update"), ("new", "version"), (math.inf, "version")]
)
@pytest.mark.parametrize("format", LOSSLESS)
def test_a_version_that_cannot_be_read_is_named(tmp_path, format, version, named):
    make, write, read = FILES[format]
    path = rewritten(write(tmp_path / "m", make()), format, version=version)
    refused(lambda: read(path), f"{path}: .*{named}")


@pytest.mark.parametrize("format", FILES)
def test_what_could_not_be_read_back_is_not_written(tmp_path, format):
    make, write, _ = FILES[format]
    path = write(tmp_path / "m", make())
    before, bad = path.read_bytes(), [replace(make(), metadata={"x": bad}) for bad in (torch.nan, path)]
    if hasattr(make(), "shading"):
        broken = {**make().parameters, "opacities": torch.full((7,), torch.inf)}
        bad.append(replace(make(), parameters=broken))
    for field in bad:
        refused(lambda field=field: write(path, field), "metadata|opacities: .* 7 infinite")
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


SHORTER = {"density": lambda x: x[:-1]}
SURFELS, GAUSSIANS = "stage, optics and metadata in the header", "filter and metadata in the header"
VOXELS, PALETTE = "a grid and its lattice", "networks and a grid"
NETWORKS = "expected the networks of a palette field"


@pytest.mark.parametrize(
    ("format", "changes", "message"),
    [
        ("model", {"stage": "cooked"}, "expected stage surfels, shading, texture, got 'cooked'"),
        ("model", {"optics": {"low_pass": 2.0, "lens": 1}}, f"expected {SURFELS}"),
        ("model", {"optics": {"material": "wood"}}, "optics: expected values"),
        ("model", {"optics": {"low_pass": -1}}, "optics: expected values"),
        *(("model", {"optics": {"low_pass": x}}, "optics: expected values") for x in ("thin", 0, True)),
        ("model", {"metadata": 3}, f"expected {SURFELS}"),
        ("model", {"tensors": {"means": None}}, "model: expected means, quats, scales, opacities"),
        ("model", {"tensors": {"texels": None}}, "expected tensor texels at stage texture, got"),
        ("model", {"tensors": {"colors": None, "sh": torch.zeros(7, 1, 3)}}, "expected tensor colors at"),
        ("model", {"tensors": {"mood": torch.zeros(3)}}, "expected tensors of a texgs model, got mood"),
        ("model", {"tensors": {"quats": torch.zeros(6, 4)}}, r"quats: expected \[7, 4\], got \[6, 4\]"),
        ("model", {"tensors": {"diffuse": torch.zeros(2)}}, r"diffuse: expected \[7\] or \[1\], got \[2\]"),
        ("model", {"tensors": {"means": torch.Tensor.double}}, "means: expected torch.float32, got torch.fl"),
        ("model", {"tensors": {"sizes": torch.Tensor.long}}, "sizes: expected torch.int32"),
        ("model", {"tensors": {"scales": lambda x: x * torch.nan}}, "scales: expected finite .*, got 14 NaN"),
        ("model", {"tensors": {"offsets": torch.arange(7) + 1000}}, ".* textures within the"),
        ("model", {"tensors": {"offsets": torch.zeros(7).long()}}, ".* texels of its own for every surfel"),
        ("gaussians", {"filter": {"antialiased": 1}}, f"expected {GAUSSIANS}"),
        ("gaussians", {"filter": None}, f"expected {GAUSSIANS}"),
        ("gaussians", {"metadata": 3}, f"expected {GAUSSIANS}"),
        ("gaussians", {"tensors": {"means": None}}, "model: expected means, .*, sh, got"),
        ("gaussians", {"tensors": {"sh": torch.zeros(7, 5, 3)}}, "sh: expected 1, 4, 9 or 16"),
        ("gaussians", {"tensors": {"mood": torch.zeros(3)}}, "model: expected means, .*, got .*mood"),
        ("gaussians", {"tensors": {"quats": torch.zeros(6, 4)}}, r"quats: expected \[7, 4\], got \[6, 4\]"),
        ("gaussians", {"tensors": {"scales": lambda x: x * torch.nan}}, "scales: .* finite .*, got 21 NaN"),
        ("voxels", {"tensors": {"sh": None}}, f"expected {VOXELS}"),
        ("voxels", {"tensors": SHORTER}, "sh: expected .* got"),
        ("voxels", {"tensors": {"masks": torch.zeros_like}}, "masks: expected the bits of"),
        ("voxels", {"tensors": {"density": lambda x: x * torch.nan}}, "density: expected finite"),
        ("voxels", {"tensors": {"sh": lambda x: x[:, :3]}}, "sh: expected 1, 4 or 9 coefficients"),
        ("voxels", {"spacing": 0}, "spacing: expected a length above 0"),
        ("voxels", {"lower": [0, 0]}, "lower: expected 3 finite numbers"),
        ("voxels", {"step": None}, f"expected {VOXELS}"),
        ("palette", {"tensors": {"light.1": None}}, f"light.1: {NETWORKS}"),
        ("palette", {"tensors": {"extra": torch.ones(1)}}, f"extra: {NETWORKS}"),
        ("palette", {"tensors": {"palette.colors": None}}, f"expected {PALETTE}"),
        ("palette", {"tensors": {"light.1": lambda x: x[:5]}}, r"light.1: .* \[64, 64\], got \[5, 64\]"),
        ("palette", {"tensors": {"free.0": None}}, f"free.0: {NETWORKS}"),
        ("palette", {"tensors": SHORTER}, "masks: expected the bits of"),
        ("palette", {"tensors": {"trunk.0": lambda x: x * torch.inf}}, "trunk.0: expected finite"),
        ("palette", {"hash": {"entries": 100}}, "entries: expected a power of two"),
        ("palette", {"step": None}, f"expected {PALETTE}"),
    ],
)
def test_what_cannot_be_used_is_named(tmp_path, format, changes, message):
    make, write, read = FILES[f"texgs-{format}"]
    path = rewritten(write(tmp_path / "m", make()), f"texgs-{format}", **changes)
    refused(lambda: read(path), f"^{path}: {message}", TexgsError)
