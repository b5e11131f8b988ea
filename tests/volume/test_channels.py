"""Volumes with several channels: one file, a cast of all that they show together, and what frames them."""

import json
from dataclasses import asdict, replace

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose, assert_array_equal

from tests.volume.march import march
from tests.volume.scenes import ball, lattice
from texgs.core.camera import orbit
from texgs.core.errors import ArgumentError
from texgs.core.light import HEADLIGHT, Light
from texgs.raster import native
from texgs.volume.basic_tfs import BasicTF, basic_tfs_of
from texgs.volume.caster import OUTPUTS, Caster, NativeTransfer, NativeView, NativeVolume
from texgs.volume.framing import frame_of
from texgs.volume.grid import Grid
from texgs.volume.isosurface import surface_of
from texgs.volume.nrrd_file import open_grid
from texgs.volume.overlay import overlay, overlays
from texgs.volume.prepare import prepare, prepare_channels
from texgs.volume.render import Appearance
from texgs.volume.slabs import ArraySource
from texgs.volume.summaries import read_summaries, write_summaries
from texgs.volume.transfer import TransferFunction, check_disjoint

CAMERA, SIDE = orbit(25, 15, 2.6, 34, 57, 43), Light("directional", 40, 30)
INNER = TransferFunction(((0.4, 0.0), (0.6, 0.05), (1.0, 0.2)), ((0.5, 0.1, 0.2, 0.9), (1, 0.4, 0.5, 0.9)))
ACROSS = TransferFunction(((-0.4, 0.0), (0.1, 0.04), (0.6, 0.1)), ((-0.4, 0.9, 0.6, 0.1),), channel=1)
BELOW = TransferFunction(((0.1, 0.0), (0.9, 0.1)), ((0.3, 0.1, 0.8, 0.2),), channel=2)
TFS = [INNER, ACROSS, BELOW]
LOOK = Appearance(step=0.5, opacity_unit=0.03)


@pytest.fixture(scope="module")
def three():
    """A ball, what grows along x, and what is below a wavy floor."""
    x, y, z = lattice(25, 21, 23)
    inside = 1 - np.sqrt(x * x + y * y + z * z)
    channels = inside, x + 0.1 * z, np.clip(-y + 0.3 * np.sin(4 * x), 0, 1)
    return Grid(channels[0], (1.0, 1.1, 0.9), others=tuple(map(np.ascontiguousarray, channels[1:])))


def cast(grid, tf, device, light=SIDE, look=LOOK):
    seen = Caster(grid, look, device).cast(tf, CAMERA, light, OUTPUTS)
    return {name: getattr(seen, name).cpu().numpy() for name in ("rgba", *OUTPUTS)}


@pytest.mark.parametrize("tf", TFS, ids=["first", "second", "third"])
def test_a_function_sees_its_channel_as_if_it_were_the_only_one(three, tf, device):
    """Bit by bit what the caster shows of the array alone."""
    alone = cast(three.channel(tf.channel), replace(tf, channel=0), device)
    for seen in (cast(three, tf, device), cast(three, [tf], device)):
        for name, plane in alone.items():
            assert_array_equal(seen[name], plane)


@pytest.mark.parametrize("tfs", [TFS[:2], TFS, TFS[1:]])
@pytest.mark.parametrize("light", [HEADLIGHT, SIDE])
def test_rays_through_several_channels_agree_with_the_definition(three, tfs, light, device):
    expected, seen = march(three, tfs, CAMERA, LOOK, light), cast(three, tfs, device, light)
    assert_allclose(seen["rgba"][..., :3], expected.color, atol=2e-3)
    assert_allclose(seen["rgba"][..., 3], expected.alpha, atol=2e-3)
    assert np.abs(seen["depth"] - expected.depth.numpy()).mean() < 2e-3
    assert np.abs(seen["normal"] - expected.normal.numpy()).mean() < 2e-3
    alone = [march(three, tf, CAMERA, LOOK, light).alpha for tf in tfs]
    mixed = expected.alpha > torch.stack(alone).amax(dim=0) + 0.03
    assert float(mixed.float().mean()) > 0.05


def test_equal_channels_show_what_one_shows_with_both_functions(device):
    """Extinctions of two functions of one volume add up in the same way. No colour is cut off at 1."""
    grid, other = ball(24), replace(ACROSS, channel=0)
    twice = replace(grid, others=(grid.values,))
    dull = replace(LOOK, specular=0)
    seen, both = cast(twice, [INNER, ACROSS], device, look=dull), overlay({"a": INNER, "b": other})
    assert_allclose(seen["rgba"], cast(grid, both, device, look=dull)["rgba"], atol=2e-3)


def test_matter_that_is_opaque_at_once_in_two_channels_has_their_mean_colour(device):
    x, _, _ = lattice(9, 9, 9)
    solid = [((-9.0, 1.0), (9.0, 1.0))] * 2
    red, blue = (
        TransferFunction(points, ((0, *color),), channel)
        for channel, (points, color) in enumerate(zip(solid, ((1, 0, 0), (0, 0, 1)), strict=True))
    )
    flat = Appearance(ambient=1, diffuse=0, specular=0)
    seen = cast(Grid(x, others=(x,)), [red, blue], device, look=flat)
    assert_allclose(seen["rgba"][21, 28], [0.5, 0, 0.5, 1], atol=1e-6)


def test_what_is_far_from_one_channel_is_not_leapt_over_in_another(device):
    """Each corner has a speck of another channel: all are seen."""
    specks = np.zeros((2, 40, 40, 40), np.float32)
    specks[0, 2:4, 2:4, 2:4] = specks[1, 36:38, 36:38, 36:38] = 1
    grid = Grid(specks[0], others=(specks[1],))
    tfs = [TransferFunction(((0.1, 0), (1, 1)), ((0, 1, 1, 1),), channel) for channel in (0, 1)]
    sums = [cast(grid, tf, device)["rgba"].sum() for tf in (*tfs, tfs)]
    assert min(sums[:2]) > 0
    assert sums[2] == pytest.approx(sums[0] + sums[1], rel=1e-4)


def test_channels_that_are_passed_by_where_they_show_nothing_change_no_bit(three, device):
    caster = Caster(three, LOOK, device)
    known = caster.cast(TFS, CAMERA, SIDE, OUTPUTS)
    ((key, (*arguments, own), kept),) = caster._prepared
    assert all(0 < cells.count_nonzero() < 0.9 * cells.numel() for cells in own)
    caster._prepared[:] = [(key, (*arguments, None), kept)]
    unknown = caster.cast(TFS, CAMERA, SIDE, OUTPUTS)
    for one, other in zip(vars(known).values(), vars(unknown).values(), strict=True):
        assert torch.equal(one, other)


def test_a_prepared_file_has_each_channel_as_it_is_alone(three, tmp_path):
    sources = [ArraySource(three.channel(k), f"c{k}") for k in range(3)]
    keys = {"up": "+z", "reduce": 2, "crop": (1, 25, 0, 20, 2, 22)}
    summaries = prepare_channels(sources, tmp_path / "all.nrrd", **keys)
    grid = open_grid(tmp_path / "all.nrrd")
    for number, source in enumerate(sources):
        file = tmp_path / f"{number}.nrrd"
        assert summaries[number] == prepare(source, file, **keys)
        alone = open_grid(file)
        assert_array_equal(grid.channel(number).values, alone.values)
        assert (grid.dims, grid.spacing, grid.origin) == (alone.dims, alone.spacing, alone.origin)
    with pytest.raises(ArgumentError, match="channel: expected one of 0 to 2, got 3"):
        grid.channel(3)


def test_a_file_with_several_channels_is_an_nrrd_of_four_axes(three, tmp_path):
    import SimpleITK

    prepare_channels([ArraySource(three.channel(k)) for k in range(3)], tmp_path / "all.nrrd")
    image = SimpleITK.ReadImage(str(tmp_path / "all.nrrd"))
    expected = np.stack([three.channel(k).values for k in range(3)])
    samples = SimpleITK.GetArrayFromImage(image)  # [Z, Y, X, C]
    assert_array_equal(np.moveaxis(samples, -1, 0), expected)


def test_channels_of_other_lattices_or_without_variation_are_refused(tmp_path):
    grid = ball(8)
    wrong = {
        "expected channels of one lattice and type": Grid(grid.values[:-1]),
        "expected a field that varies": Grid(0 * grid.values),
        "one lattice": Grid(grid.values.astype(np.float64)),
    }
    for message, other in wrong.items():
        with pytest.raises(ArgumentError, match=message):
            prepare_channels([ArraySource(grid), ArraySource(other)], tmp_path / "all.nrrd")
        assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("count", ["0", "3", "99999999999"])
def test_a_header_with_another_number_of_channels_is_refused(tmp_path, count):
    grid = ball(8)
    prepare_channels([ArraySource(grid), ArraySource(grid)], file := tmp_path / "all.nrrd")
    file.write_bytes(file.read_bytes().replace(b"sizes: 8 8 8 2", f"sizes: 8 8 8 {count}".encode()))
    with pytest.raises(ArgumentError, match=r"all\.nrrd: "):
        open_grid(file)


def test_a_header_with_more_masks_than_the_file_has_is_refused(tmp_path):
    prepare_channels([ArraySource(ball(8)), ArraySource(ball(8))], file := tmp_path / "all.nrrd")
    file.write_bytes(file.read_bytes().replace(b"\n#-", b"\nmasksoflabels:=99999999999\n#-", 1))
    with pytest.raises(ArgumentError, match=r"all\.nrrd: "):
        open_grid(file)


def test_the_frame_is_around_what_all_channels_show():
    """Two balls of radius 0.2 in the world, 0.5 apart: each channel has one."""
    x, y, z = lattice(41, 41, 41)
    left, right = (1 - np.sqrt((x - place) ** 2 + y * y + z * z) for place in (-0.5, 0.5))
    grid, tfs = (
        Grid(left, others=(right,)),
        [TransferFunction(((0.6, 0), (1, 1)), ((0, 1, 1, 1),), c) for c in (0, 1)],
    )
    for places, radius, chosen in ([-0.25], 0.2, tfs[:1]), ([0.25], 0.2, tfs[1:]), ([0.0], 0.45, tfs):
        frame = frame_of(grid, chosen)
        assert_allclose(frame.target, [*places, 0, 0], atol=0.01)
        assert frame.radius == pytest.approx(radius, abs=0.05)  # and the cells at its rim


def test_surfaces_are_those_of_a_function_s_channel(three):
    for tf in TFS[1:]:
        alone, own = three.channel(tf.channel), replace(tf, channel=0)
        level = 0.5 * tf.opacity[-1][1]
        assert_array_equal(surface_of(three, tf, level).vertices, surface_of(alone, own, level).vertices)


def test_only_functions_of_one_channel_must_not_overlap():
    here, there = INNER, replace(INNER, channel=1)
    check_disjoint({"here": here, "there": there})
    with pytest.raises(ArgumentError, match="here and too: expected ranges"):
        check_disjoint({"here": here, "there": there, "too": here})
    assert [tf.channel for tf in overlays({"b": there, "a": here, "too": here})] == [1, 0]


def test_a_function_keeps_its_channel_through_all_that_is_made_of_it():
    made = [ACROSS.with_values(lambda v: 2 * v), ACROSS.rounded(-1, 1), ACROSS.without_steps()]
    made += [
        overlay({"a": ACROSS, "b": ACROSS}),
        overlay({"a": ACROSS}),
        TransferFunction.from_dict(ACROSS.to_dict()),
    ]
    assert [tf.channel for tf in made] == [1] * len(made)
    assert made[-1] == ACROSS
    assert "channel" not in INNER.to_dict()


@pytest.mark.parametrize("channel", [-1, 1.0, True])
def test_a_channel_that_is_no_number_is_refused(channel):
    with pytest.raises(ArgumentError, match="channel: expected a number from 0 on, got"):
        TransferFunction.from_dict({**INNER.to_dict(), "channel": channel})


def test_functions_in_fractions_are_of_the_range_of_their_channel(tmp_path):
    sources = [ArraySource(Grid(ball(8).values * factor)) for factor in (1, 100)]
    volume = tmp_path / "volume.nrrd"
    summaries = prepare_channels(sources, volume)
    write_summaries(volume, summaries, ["DAPI", "GFP"])
    assert list(read_summaries(volume)) == ["DAPI", "GFP"]
    half = BasicTF([[0.5, 0.1], [1.0, 1.0]], [[0.5, 1, 1, 1]])
    tfs = basic_tfs_of(
        volume, {"a": replace(half, channel="GFP"), "b": replace(half, channel="DAPI")}, "fraction"
    )
    assert [tf.channel for tf in tfs.values()] == [1, 0]
    assert [tf.support[1] for tf in tfs.values()] == [each.maximum for each in summaries[::-1]]
    with pytest.raises(ArgumentError, match=r"basic TF c: expected a channel of DAPI, GFP, got None"):
        basic_tfs_of(volume, {"c": half}, "fraction")


def test_one_channel_is_summarized_as_ever(tmp_path):
    """Whatever its name is: volume.json is the summary, and a function may name the channel."""
    volume = tmp_path / "volume.nrrd"
    summary = prepare(ArraySource(ball(8)), volume)
    write_summaries(volume, [summary], ["DAPI"])
    assert json.loads((tmp_path / "volume.json").read_text()) == json.loads(json.dumps(asdict(summary)))
    (tf,) = basic_tfs_of(volume, {"a": BasicTF([[0, 0], [1, 1]], [[0, 1, 1, 1]], "DAPI")}, "data").values()
    assert tf.channel == 0


def test_the_library_refuses_channels_that_do_not_fit_together():
    values, points = torch.zeros(2, 2, 2), torch.tensor([[0.0, 0, 1, 1, 1], [1, 1, 1, 1, 1]])
    volume = NativeVolume(values, 8, (2, 2, 2), (0.5, 0.5, 0.5))
    longer = NativeVolume(torch.zeros(3, 2, 2), 8, (2, 2, 3), (0.5, 0.5, 0.5))
    transfer, view = NativeTransfer(2, points), NativeView()
    distance, cells = torch.zeros(4, dtype=torch.uint8), torch.zeros(1, 2, dtype=torch.int32)
    for volumes, message in (([volume] * 17, "1 to 16"), ([volume, longer], "one lattice")):
        n = len(volumes)
        arrays = (NativeVolume * n)(*volumes), (NativeTransfer * n)(*[transfer] * n)
        with pytest.raises(ArgumentError, match=message):
            native.call("texgs_cast", *arrays, n, distance, cells, None, view, device=torch.device("cpu"))
