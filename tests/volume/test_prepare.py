import itertools
import subprocess
import sys
from collections import Counter, namedtuple
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from texgs.core.errors import ArgumentError
from texgs.volume import slabs
from texgs.volume.grid import Grid
from texgs.volume.nrrd_file import NRRD_TYPES, open_grid
from texgs.volume.prepare import prepare
from texgs.volume.slabs import ArraySource
from texgs.volume.sources import open_source
from texgs.volume.summaries import BINS, summarize

# World coordinates in those of the volume, written out by hand: rotations that take an axis to +y.
WORLD = {
    "+y": lambda x, y, z: (x, y, z),
    "-y": lambda x, y, z: (x, -y, -z),
    "+z": lambda x, y, z: (x, z, -y),
    "-z": lambda x, y, z: (x, -z, y),
    "+x": lambda x, y, z: (-y, x, z),
    "-x": lambda x, y, z: (y, -x, z),
}


def source_of(values, spacing=(1.0, 1.0, 1.0), origin=(0.0, 0.0, 0.0)):
    return ArraySource(Grid(np.asarray(values), spacing, origin))


def reduced(values, factor, method):
    """Oracle: block by block."""
    ranges = [range(0, size, factor) for size in values.shape]
    out = np.empty([len(r) for r in ranges], np.float64)
    for index, (z, y, x) in zip(np.ndindex(*out.shape), itertools.product(*ranges), strict=True):
        block = values[z : z + factor, y : y + factor, x : x + factor]
        middle = tuple(size // 2 for size in block.shape)
        out[index] = block.mean(dtype=np.float64) if method == "mean" else block[middle]
    return (np.rint(out) if values.dtype.kind != "f" else out).astype(values.dtype)


@st.composite
def jobs(draw):
    """A small volume with a crop, a reduction and an axis that points up; two samples are left."""
    dims = draw(st.tuples(*[st.integers(2, 9)] * 3))
    reduce = draw(st.integers(1, min(dims) - 1))
    crop = []
    for size in dims:
        length = draw(st.integers(reduce + 1, size))
        start = draw(st.integers(0, size - length))
        crop += [start, start + length]
    dtype = draw(st.sampled_from(tuple(NRRD_TYPES)))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    values = rng.integers(-128, 128, dims[::-1]).astype(dtype)
    values.flat[0], values.flat[-1] = 0, 1
    return values, tuple(crop), reduce


@settings(max_examples=60, deadline=None)
@given(job=jobs(), up=st.sampled_from(list(WORLD)), method=st.sampled_from(["mean", "sample"]))
def test_any_job_agrees_with_numpy_at_world_positions(tmp_path_factory, job, up, method):
    values, crop, reduce = job
    x0, x1, y0, y1, z0, z1 = crop
    expected = reduced(values[z0:z1, y0:y1, x0:x1], reduce, method)
    if expected.min() == expected.max():
        return
    spacing, origin = (0.5, 2.0, 3.0), (1.0, -2.0, 4.0)
    path = tmp_path_factory.mktemp("job") / "v.nrrd"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(slabs, "SLAB_BYTES", 1)  # as many slabs as there can be
        source = source_of(values, spacing, origin)
        summary = prepare(source, path, crop=crop, reduce=reduce, method=method, up=up)
    grid = open_grid(path)
    assert (grid.dims, grid.values.dtype) == (summary.dims, values.dtype)
    start = np.array(origin) + (np.array([x0, y0, z0]) + 0.5 * (reduce - 1)) * spacing
    np.testing.assert_array_equal(grid.space.axes, np.stack([WORLD[up](*row) for row in np.eye(3)], axis=1))
    for z, y, x in np.ndindex(*expected.shape):
        place = start + np.array([x, y, z]) * reduce * spacing
        index = np.rint(np.array(grid.space.axes) @ (place - grid.origin) / grid.spacing).astype(int)
        np.testing.assert_allclose(grid.space.place(grid.origin, index * grid.spacing), place, atol=1e-9)
        assert grid.values[tuple(index[::-1])] == expected[z, y, x]


@pytest.mark.parametrize(
    ("dtype", "kept"),
    [
        *(("bool", "uint8"), ("int8", "int8"), (">u2", "uint16"), (">f4", "float32")),
        *((wide, "float32") for wide in ("int32", "uint64", "float16", "float64")),
    ],
)
def test_types(tmp_path, dtype, kept):
    values = np.random.default_rng(0).integers(0, 2, (4, 5, 6)).astype(dtype)
    assert prepare(source_of(values), tmp_path / "v.nrrd").dtype == kept
    grid = open_grid(tmp_path / "v.nrrd")
    assert grid.values.dtype == kept
    np.testing.assert_array_equal(grid.values, values)


RNG = np.random.default_rng(0)
VALUES = {
    "uint8": RNG.integers(3, 200, (6, 5, 4)).astype(np.uint8),
    "int16": RNG.integers(-3000, 3000, (6, 5, 4)).astype(np.int16),
    "int32": RNG.integers(-(2**31), 2**31, (6, 5, 4)).astype(np.int32),
    "float32": RNG.normal(size=(6, 5, 4)).astype(np.float32),
    "ten steps of float32": (1e7 + RNG.integers(0, 10, (6, 5, 4))).astype(np.float32),
    "ten steps of float64": 1e16 + 2.0 * RNG.integers(0, 10, (6, 5, 4)),
    "smallest numbers": np.linspace(0, 3e-45, 120).reshape(6, 5, 4).astype(np.float32),
    "largest numbers": np.linspace(-3.4e38, 3.4e38, 120).reshape(6, 5, 4).astype(np.float32),
}


def counts(values):
    """Oracle: the bin of each sample in exact arithmetic."""
    numbers = [Fraction(value.item()) for value in values.ravel()]
    low, high = min(numbers), max(numbers)
    bins = Counter(min(int((number - low) * BINS / (high - low)), BINS - 1) for number in numbers)
    return tuple(bins[index] for index in range(BINS))


@pytest.mark.parametrize("values", VALUES.values(), ids=VALUES.keys())
def test_lattice_range_and_histogram(tmp_path, values):
    source = source_of(values, (1.0, 2.0, 3.0), (-1.0, 0.0, 1.0))
    summary = summarize(source, float(values.min()), float(values.max()))
    assert (summary.dims, summary.dtype, summary.voxels) == ((4, 5, 6), values.dtype.name, 120)
    assert (summary.spacing, summary.origin) == ((1.0, 2.0, 3.0), (-1.0, 0.0, 1.0))
    assert summary.histogram == counts(values)
    if values.dtype.name in NRRD_TYPES:
        assert prepare(source, tmp_path / "v.nrrd") == summary


def test_values_that_are_not_finite(tmp_path):
    values = np.arange(4 * 5 * 6, dtype=np.float64).reshape(4, 5, 6)
    values[2, 3, 4], values[3, 0, 0] = np.nan, -np.inf
    with pytest.raises(ArgumentError, match=r"got 2 .* at \(x, y, z\) = \(4, 3, 2\); set nan_value to repl"):
        prepare(source_of(values), tmp_path / "v.nrrd", crop=(0, 6, 0, 5, 1, 4), up="-z", reduce=2)
    assert list(tmp_path.iterdir()) == []
    prepare(source_of(values), tmp_path / "v.nrrd", nan_value=-7)
    expected = np.where(np.isfinite(values), values, -7).astype(np.float32)
    np.testing.assert_array_equal(open_grid(tmp_path / "v.nrrd").values, expected)


def test_mistakes_are_named_and_leave_the_old_file(tmp_path):
    target = tmp_path / "v.nrrd"
    target.write_text("old")
    ramp = np.arange(60).reshape(3, 4, 5)
    for values, arguments, message in [
        (np.full((3, 4, 5), 7), {}, "volume: expected a field that varies, but every sample is 7; choose"),
        (ramp * 1e300, {}, r"expected samples that fit float32, got up to 5.9e\+301; scale"),
        (ramp, {"crop": (0, 5, 0, 5, 0, 3)}, "crop: expected 0 <= y0 < y1 <= 4, got 0 and 5"),
        (ramp, {"crop": (0, 5, 0, 4)}, "crop: expected six integers"),
        (ramp, {"crop": (0, 5, 0, 4, 1, 2)}, "crop and reduce leave 5 x 4 x 1; crop or reduce less"),
        (ramp, {"nan_value": float("nan")}, "nan_value: expected a finite float32, got nan"),
    ]:
        with pytest.raises(ArgumentError, match=message):
            prepare(source_of(values), target, **arguments)
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_progress_sees_every_slab_and_an_interrupt_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(slabs, "SLAB_BYTES", 1)
    seen = []

    def progress(steps, total):
        for step in steps:
            seen.append((step, total))
            yield step

    source = source_of(np.arange(60).reshape(3, 4, 5))
    prepare(source, tmp_path / "v.nrrd", progress=progress)
    assert seen == [((0, 0, 1), 3), ((0, 1, 2), 3), ((0, 2, 3), 3)]

    def interrupt(steps, total):
        yield steps[0]
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        prepare(source, tmp_path / "w.nrrd", progress=interrupt)
    assert [path.name for path in tmp_path.iterdir()] == ["v.nrrd"]


def test_a_target_that_is_its_own_source(tmp_path):
    values = np.arange(60, dtype=np.uint8).reshape(3, 4, 5)
    prepare(source_of(values), tmp_path / "v.nrrd")
    prepare(open_source(tmp_path / "v.nrrd"), tmp_path / "v.nrrd", up="-y")
    np.testing.assert_array_equal(open_grid(tmp_path / "v.nrrd").values, values[::-1, ::-1])


PEAK = """
import sys
from pathlib import Path
from texgs.volume.sources import open_source
from texgs.volume.prepare import prepare
edge = int(sys.argv[2])
source = open_source(sys.argv[1], dims=(edge, edge, edge), dtype="uint8")
prepare(source, Path(sys.argv[1] + ".nrrd"), reduce=int(sys.argv[3]), up="+z")
status = Path("/proc/self/status").read_text().split()
print(status[status.index("VmHWM:") + 1])  # kB
"""


@pytest.mark.skipif(sys.platform != "linux", reason="the peak is read from /proc")
@pytest.mark.parametrize(("edge", "reduce"), [(640, 8), (640, 1)])
def test_memory_does_not_grow_with_the_volume(tmp_path, edge, reduce):
    path = tmp_path / "v.raw"
    with path.open("wb") as file:
        file.truncate(edge**3)  # sparse: takes no room on the disk
        file.write(bytes([255]) * edge**2)
    command = [sys.executable, "-c", PEAK, str(path), str(edge), str(reduce)]
    peak = int(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    # Python and numpy take 40 MB, a slab of 8 MB and what is computed from it the rest.
    assert peak < 150_000


def test_a_volume_that_does_not_fit_on_the_disk_is_refused_before_it_is_written(tmp_path, monkeypatch):
    monkeypatch.setattr("texgs.volume.prepare.disk_usage", lambda folder: namedtuple("Usage", "free")(2**30))
    values = np.broadcast_to(np.arange(2048, dtype=np.uint8), (1024, 1024, 2048))
    with pytest.raises(ArgumentError, match="needs 2 GiB of disk, but 1 GiB are free; crop or reduce it"):
        prepare(source_of(values), tmp_path / "v.nrrd")
    assert not list(tmp_path.iterdir())
