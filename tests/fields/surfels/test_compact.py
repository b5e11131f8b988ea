import json
import lzma
from contextlib import suppress
from dataclasses import replace

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from safetensors.numpy import load, save

from tests.fields.surfels.samples import STAGES, same, sample
from tests.fields.surfels.test_composition import ball
from tests.refusals import refused
from texgs.core.camera import orbit
from texgs.core.errors import ArgumentError, ShapeError, TexgsError
from texgs.core.geometry import quats_to_matrices
from texgs.fields.surfels.compact import TEXEL_STEP, open_model, read_compact, seen_surfels, write_compact
from texgs.fields.surfels.model_file import write_model
from texgs.metrics.quality import psnr


def changed(model, **parameters):
    return replace(model, parameters={**model.parameters, **parameters})


def rewritten(path, **header):
    """A valid file with some keys of its first line changed."""
    line, _, packed = write_compact(path, sample()).read_bytes().partition(b"\n")
    path.write_bytes(
        json.dumps({**json.loads(line), **header}, separators=(",", ":")).encode() + b"\n" + packed
    )
    return path


@pytest.mark.parametrize("stage", STAGES)
@pytest.mark.parametrize("shared", [False, True])
def test_every_tensor_comes_back_within_its_bound(tmp_path, stage, shared):
    model = sample(stage, shared=shared, low_pass=2.5, material="paper", local_viewer=False)
    restored = read_compact(write_compact(tmp_path / "new" / "model.texgs", model))
    assert (restored.stage, restored.shading, restored.metadata) == (stage, model.shading, model.metadata)
    given, got = dict(model.parameters), dict(restored.parameters)
    assert given.keys() == got.keys()
    for name in {"means", "palette", "sizes", "offsets"} & given.keys():
        assert torch.equal(got.pop(name), given.pop(name)), name
    rotations = [quats_to_matrices(p.pop("quats")) for p in (got, given)]
    assert float((rotations[0] - rotations[1]).abs().max()) < 2e-3
    if stage == "texture":
        assert float((got.pop("texels") - given.pop("texels")).abs().max()) <= TEXEL_STEP / 2
    for name, values in given.items():
        bound = 0 if shared and values.shape == (1,) else 2**-11 * values.abs() + 2**-24
        assert bool(((got[name] - values).abs() <= bound).all()), name


@settings(max_examples=50, deadline=None)
@given(
    texels=st.lists(st.floats(-6e4, 6e4, width=32), min_size=3, max_size=3),
    step=st.sampled_from([1 / 128, 1 / 64, 0.1]),
)
def test_no_texel_is_off_by_more_than_half_a_step(tmp_path_factory, texels, step):
    model = sample(n=1)
    p = {"texels": torch.tensor([texels]), "sizes": torch.ones(1, 2, dtype=torch.int32)}
    model = changed(model, **p)
    restored = read_compact(write_compact(tmp_path_factory.mktemp("m") / "m", model, step=step))
    error = (restored.parameters["texels"] - p["texels"]).abs()
    assert bool((error <= step / 2 + 2**-23 * p["texels"].abs()).all())


def test_textures_in_any_order_come_back_one_after_the_other(tmp_path):
    model = sample(n=4)
    p = model.parameters
    order = torch.tensor([2, 0, 3, 1])
    shuffled = changed(model, sizes=p["sizes"][order], offsets=p["offsets"][order])
    restored = read_compact(write_compact(tmp_path / "m", shuffled)).parameters
    for n, old in enumerate(order.tolist()):
        count = int(p["sizes"][old].prod())
        got = restored["texels"][restored["offsets"][n] :][:count]
        assert float((got - p["texels"][p["offsets"][old] :][:count]).abs().max()) <= TEXEL_STEP / 2


def test_colors_hardly_change_and_the_file_is_an_eighth(tmp_path):
    model = ball(1, n=3000)
    p = model.parameters
    sizes = torch.full_like(p["sizes"], 8)
    g = torch.Generator().manual_seed(0)
    # Channels are alike, as those of fitted textures, which correct light and shade, are.
    texels = 0.03 * torch.randn(3000 * 64, 1, generator=g) + 0.002 * torch.randn(3000 * 64, 3, generator=g)
    model = changed(model, sizes=sizes, offsets=torch.arange(3000) * 64, texels=texels)
    path = write_compact(tmp_path / "m", model)
    restored = read_compact(path)
    assert path.stat().st_size < texels.nbytes / 8
    for azimuth in (0, 120, 240):
        camera = orbit(azimuth, 20, 3, 40, 128, 128)
        one, other = (m.render(camera).color for m in (model, restored))
        assert psnr(other, one) > 54.3, "costs a model at 38 dB less than 0.1 dB"


def test_unseen_surfels_keep_one_mean_texel(tmp_path):
    model = ball(1)
    p = model.parameters
    seen = torch.rand(len(model), generator=torch.Generator().manual_seed(0)) > 0.5
    restored = read_compact(write_compact(tmp_path / "m", model, seen)).parameters
    assert torch.equal(restored["sizes"][seen], p["sizes"][seen])
    assert bool((restored["sizes"][~seen] == 1).all())
    for n in range(len(model)):
        count = int(p["sizes"][n].prod())
        old = p["texels"][p["offsets"][n] :][:count]
        new = restored["texels"][restored["offsets"][n] :][: int(restored["sizes"][n].prod())]
        assert float((new - (old if seen[n] else old.mean(0))).abs().max()) <= TEXEL_STEP / 2 + 1e-6
    one_stage = sample("shading")
    restored = read_compact(write_compact(tmp_path / "s", one_stage, torch.zeros(7, dtype=torch.bool)))
    assert len(restored) == 7, "a model without texture has none to drop"


def test_a_surfel_behind_an_opaque_wall_is_unseen():
    depths = torch.tensor([0.12, 0.11, 0.1, -0.1])  # three, because the alpha of one is at most 0.99
    n = len(depths)
    p = {
        "means": depths[:, None] * torch.tensor([0.0, 0.0, 1.0]),
        "quats": torch.tensor([[1.0, 0, 0, 0]]).repeat(n, 1),
        "scales": torch.log(torch.tensor([0.5, 0.5, 0.5, 0.01]))[:, None].repeat(1, 2),
        "opacities": torch.full((n,), 16.0),
        "sh": torch.zeros(n, 1, 3),
    }
    model = replace(sample("surfels"), parameters=p)
    front, back = (orbit(azimuth, 0, 3, 20, 64, 64) for azimuth in (-90, 90))
    assert seen_surfels(model, [front]).tolist()[2:] == [True, False]
    assert seen_surfels(model, [front, back]).tolist()[2:] == [True, True]


def test_what_half_precision_cannot_hold_stays(tmp_path):
    model = sample("shading")
    colors = model.parameters["colors"] * 1e6
    restored = read_compact(write_compact(tmp_path / "m", changed(model, colors=colors)))
    assert torch.equal(restored.parameters["colors"], colors)


def test_no_surfels_are_a_model(tmp_path):
    model = sample(n=0)
    assert same(read_compact(write_compact(tmp_path / "m", model)), model)


def test_the_format_is_public(tmp_path):
    line, _, packed = write_compact(tmp_path / "m", sample(low_pass=3.0)).read_bytes().partition(b"\n")
    header = json.loads(line)
    assert (header["texgs-compact"], header["step"], header["model"]["stage"]) == (1, TEXEL_STEP, "texture")
    stored = load(lzma.decompress(packed))
    assert stored["codes"].dtype == "uint8"
    assert stored["codes"].shape[1:] == (3, len(sample().parameters["texels"]))


def test_models_open_from_either_kind_of_file(tmp_path):
    lossless, compact = write_model(tmp_path / "a", ball(1)), write_compact(tmp_path / "b", ball(1))
    assert same(open_model(lossless), ball(1))
    assert same(open_model(compact), read_compact(compact))


@settings(max_examples=100, deadline=None)
@given(place=st.floats(0, 1, exclude_max=True), value=st.integers(0, 255))
def test_a_changed_byte_gives_a_model_or_a_sentence(tmp_path_factory, place, value):
    path = write_compact(tmp_path_factory.mktemp("m") / "m", sample(n=2))
    data = bytearray(path.read_bytes())
    start = data.index(b"\n") + 1
    is_damaged = data[int(place * len(data))] != value
    data[int(place * len(data))] = value
    path.write_bytes(data)
    if is_damaged and int(place * len(data)) >= start:
        refused(lambda: read_compact(path), "cut short or damaged")
    else:
        with suppress(TexgsError):
            read_compact(path)


def packed(path, data):
    line = write_compact(path, sample()).read_bytes().partition(b"\n")[0]
    path.write_bytes(line + b"\n" + lzma.compress(data))
    return path


def test_files_that_are_no_compact_model_are_named(tmp_path):
    path = packed(tmp_path / "m", b"no safetensors")
    refused(lambda: read_compact(path), "cut short or damaged")
    whole = load(lzma.decompress(write_compact(path, sample()).read_bytes().partition(b"\n")[2]))
    codes = whole["codes"]
    for wrong in ({"codes": codes[0]}, {"codes": codes.astype("f4")}, {"sizes": whole["means"]}):
        packed(path, save({**whole, **wrong}))
        refused(lambda: read_compact(path), str(path), TexgsError)


@pytest.mark.parametrize(
    "change",
    [
        *({"texgs-compact": version} for version in (2, "new")),
        *({"step": step} for step in (0, "fine")),
        *({"model": model} for model in (3, {"stage": "texture"})),
    ],
)
def test_a_first_line_that_cannot_be_used_is_named(tmp_path, change):
    path = rewritten(tmp_path / "m", **change)
    refused(lambda: read_compact(path), f"{path}: expected (version|stage)")


def test_what_cannot_be_written_is_named_and_leaves_nothing(tmp_path):
    model = sample()
    for given_model, words, error in (
        (changed(model, texels=model.parameters["texels"] + 1e6), {}, ArgumentError),
        (model, {"step": 0}, ArgumentError),
        (model, {"seen": torch.ones(7)}, ArgumentError),
        (model, {"seen": torch.ones(3, dtype=torch.bool)}, ShapeError),
    ):
        named = next(iter(words), "texels")
        refused(lambda m=given_model, w=words: write_compact(tmp_path / "m", m, **w), f"{named}: ", error)
    assert not list(tmp_path.iterdir())
