"""Light through the volume of a page: extinctions and sweeps, against formulas and those of texgs."""

import numpy as np
import pytest
import torch

from texgs.core.cuts import Cuts, Plane
from texgs.viewer.standalone import joined_modules
from texgs.volume.caster import Caster
from texgs.volume.grid import Grid
from texgs.volume.matter import SKY_DIRECTIONS, Matter, even_directions
from texgs.volume.render import Appearance
from texgs.volume.transfer import TransferFunction

UNIT = 0.1  # of length, world units
ENTRIES = 4096  # of a table over the values
START = """
const { Matter, evenDirections, valueAt } = modules["light_cells.js"];
Object.assign(globalThis, { evenDirections });
globalThis.sweep = ({ codes, sizes, half, unit, longest, extinctions, planes, direction, sky, points }) => {
  const table = Float32Array.from(extinctions.flatMap((extinction) => [0, 0, 0, extinction]));
  const facts = { half, appearance: { opacity_unit: unit } };
  const tables = [{ table, channel: 0, mask: -1 }], samples = { channels: [Uint8Array.from(codes)], sizes };
  const matter = new Matter(samples, facts, longest, tables, planes);
  const light = () => sky ? matter.opened(sky.reach, evenDirections(sky.count)) : matter.lit(direction);
  const cells = sky || direction ? light() : matter.extinctions;
  return { ...cells, values: [...cells.values], at: points.map((point) => valueAt(cells, ...point)) };
};
"""
DIRECTIONS = [(1, 0, 0), (0, -1, 0), (0, 0, 1), (1, 2, -3), (-3, 1, 2), (2, -2, 1.9), (1, 1, 1)]
HALF = Plane([0.3, 1.0, -0.2], 0.05)


@pytest.fixture(scope="module")
def page(chromium):
    """A page with light_cells.js."""
    page, errors = chromium.new_page(), []
    page.on("pageerror", lambda error: errors.append(str(error)))
    script = f"<script type=module>{joined_modules('light_cells.js')}{START}</script>"
    page.set_content(f"<!doctype html><body>{script}")
    page.wait_for_function("globalThis.sweep !== undefined")
    yield page
    assert errors == []


@pytest.fixture
def sweep(page):
    """What it makes of samples: cells [Z, Y, X], and values at points."""

    def swept(codes, half, extinctions, longest=32, **asked):
        words = {
            "codes": codes.ravel().tolist(),
            "sizes": codes.shape[::-1],
            "half": half,
            "longest": longest,
        }
        words |= {"unit": UNIT, "extinctions": extinctions.tolist(), "planes": [], "points": []}
        cells = page.evaluate("words => sweep(words)", words | asked)
        return np.array(cells["values"]).reshape(cells["size"][::-1]), cells

    return swept


def unit(direction):
    return (np.array(direction) / np.linalg.norm(direction)).tolist()


def centers(cells):
    """Places [Z, Y, X, 3] of the centres of cells."""
    axes = [((np.arange(n) + 0.5) / n * 2 - 1) * h for n, h in zip(cells["size"], cells["half"], strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).transpose(2, 1, 0, 3)


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_light_falls_off_with_its_way_through_even_matter(sweep, direction):
    half, codes = [0.5, 0.4, 0.3], np.full((25, 33, 41), 99, np.uint8)
    shares, cells = sweep(codes, half, np.full(ENTRIES, 0.2), direction=unit(direction))
    to, axes = np.array(unit(direction)), np.flatnonzero(direction)
    inner = (slice(1, -1),) * 3  # cells around the volume are empty
    ways = ((np.sign(to) * half - centers(cells)[inner])[..., axes] / to[axes]).min(axis=-1)
    expected, shares = 255 * 2 ** (-0.2 / UNIT * ways), shares[inner]
    assert cells["size"] == [34, 28, 21]
    assert np.abs(shares - expected).mean() < 1
    assert np.abs(shares - expected).max() < 12, "light comes in softly at the edges of the box"


def test_nothing_hides_no_light(sweep):
    codes = np.random.default_rng(0).integers(0, 256, (9, 10, 11)).astype(np.uint8)
    for asked in ({"direction": unit((1, 2, -3))}, {"sky": {"reach": 0.3, "count": SKY_DIRECTIONS}}):
        shares, _ = sweep(codes, [0.5, 0.45, 0.4], np.zeros(ENTRIES), **asked)
        assert (shares == 255).all()


def test_a_thin_sheet_between_samples_takes_its_part_of_light(sweep):
    """Its value is that of no sample: means between samples count, not values of samples."""
    codes = np.broadcast_to(np.where(np.arange(33) < 16, 20, 220).astype(np.uint8), (33, 33, 33))
    table = np.where(np.abs(np.arange(ENTRIES) / (ENTRIES - 1) * 255 - 120) < 10, 1.0, 0.0)
    shares, _ = sweep(codes, [0.5] * 3, table, direction=[1, 0, 0])
    thickness = 20 / 200 / 32  # world units: a tenth of the way between two samples
    assert np.abs(shares[4:-4, 4:-4, :15] - 255 * 2 ** (-thickness / UNIT)).max() < 2
    assert (shares[..., 17:] == 255).all()


def lumps(seed=2, shape=(51, 57, 65)):
    """A smooth random body in codes, with empty edges."""
    noise = np.fft.fftn(np.random.default_rng(seed).normal(size=shape))
    along = np.meshgrid(*(np.fft.fftfreq(n) for n in shape), indexing="ij")
    smooth = np.fft.ifftn(noise * np.exp(-1000 * sum(x**2 for x in along))).real
    return ((smooth - smooth.min()) / np.ptp(smooth) * 255).round().astype(np.uint8)


def test_cells_are_those_of_texgs(sweep):
    codes = lumps()
    codes[0, 0, :2] = 0, 255
    caster = Caster(Grid(codes), Appearance(opacity_unit=UNIT))
    tf = TransferFunction(((140, 0), (170, 0.95), (255, 0.95)), ((140, 0.5, 0.5, 0.5), (255, 0.5, 0.5, 0.5)))
    values = np.linspace(0, 255, ENTRIES)
    opacity = np.where(values < 140, 0, np.interp(values, *zip(*tf.opacity, strict=True)))
    table, half = -np.log2(1 - opacity), list(caster.half)
    for cuts in (Cuts(), Cuts([HALF])):
        planes = [{"normal": [*plane.normal], "offset": plane.offset} for plane in cuts.planes]
        matter = Matter(caster, [tf], UNIT, cuts, longest=32)
        asked = {"planes": planes, "longest": 32}
        met, cells = sweep(codes, half, table, **asked)
        difference = np.abs(met * cells["edge"] - matter.extinction.numpy())
        assert met.max() > 0
        assert difference.mean() < 0.03 * matter.extinction.numpy().mean()
        for direction in DIRECTIONS:
            lit, _ = sweep(codes, half, table, **asked, direction=unit(direction))
            expected = matter.lit(torch.tensor(unit(direction)), None).light[..., 0].numpy().astype(float)
            assert expected.std() > 20
            assert np.abs(lit - expected).mean() < 1.5
        opened, cells = sweep(codes, half, table, **asked, sky={"reach": 0.2, "count": SKY_DIRECTIONS})
        expected = matter.lit(None, 0.2)
        assert np.abs(opened - expected.light[..., 1].numpy().astype(float)).mean() < 1.5
        assert expected.light[..., 1].float().std() > 10
        assert cells["outset"] == pytest.approx(expected.outset)


def test_values_are_linear_between_centres_and_even_beyond(sweep):
    codes, half = lumps(), [0.5, 0.45, 0.4]
    points = np.random.default_rng(1).uniform(-0.6, 0.6, (50, 3))
    table = np.where(np.arange(ENTRIES) > 2500, 0.5, 0)
    values, cells = sweep(codes, half, table, direction=unit((1, 2, -3)), points=points.tolist())
    grid = torch.tensor(values, dtype=torch.float64)[None, None]
    places = torch.tensor(points / cells["half"])[None, None, None]
    expected = torch.nn.functional.grid_sample(grid, places, padding_mode="border", align_corners=False)
    assert np.allclose(cells["at"], expected.flatten(), atol=1e-6)


def test_directions_are_those_of_texgs(page):
    got = page.evaluate("count => evenDirections(count)", SKY_DIRECTIONS)
    assert np.allclose(got, even_directions(SKY_DIRECTIONS), atol=1e-6)
