"""The native hash encoding against its definition, and that against plain loops and finite differences."""

import pytest
import torch

from tests.raster.threads import require_same_bits
from texgs.core.errors import ArgumentError, DeviceError, ShapeError
from texgs.raster.hash_encoding import HashLevels, encode
from texgs.raster.reference import hash_encoding as definition

SMALL = HashLevels(levels=5, entries=512, coarsest=4, finest=50)  # the first level has a row for each point


def scene(n=700, levels=SMALL, seed=0):
    """Points, some on faces and some outside of the cube, and a table."""
    generator = torch.Generator().manual_seed(seed)
    points = 1.1 * torch.rand(n, 3, generator=generator) - 0.05
    points[:8] = torch.cartesian_prod(*[torch.tensor([0.0, 1.0])] * 3)
    return points, torch.randn(levels.rows, 2, generator=generator)


def looped(point, table, levels):
    """Features of one point, corner by corner, in the numbers of Python."""
    features = []
    for level, resolution in enumerate(levels.resolutions):
        start, end = levels.first[level : level + 2]
        place = [resolution * min(max(x, 0.0), 1.0) for x in point]
        cell = [min(int(x), resolution - 1) for x in place]
        feature = [0.0, 0.0]
        for corner in range(8):
            weight, at = 1.0, []
            for axis in range(3):
                step, inside = corner >> axis & 1, place[axis] - cell[axis]
                weight *= inside if step else 1 - inside
                at.append(cell[axis] + step)
            if (resolution + 1) ** 3 <= end - start:
                row = at[0] + (resolution + 1) * (at[1] + (resolution + 1) * at[2])
            else:
                row = (at[0] ^ at[1] * 2654435761 ^ at[2] * 805459861) % 2**32 % (end - start)
            feature = [f + weight * table[start + row][c] for c, f in enumerate(feature)]
        features += feature
    return features


def test_the_definition_is_that_of_plain_loops():
    points, table = (x.double() for x in scene(60))
    rows = table.tolist()
    expected = torch.tensor([looped(point, rows, SMALL) for point in points.tolist()], dtype=torch.float64)
    torch.testing.assert_close(definition.encode(points, table, SMALL), expected)


def test_the_definition_has_the_gradient_of_finite_differences():
    points, table = (x.double() for x in scene(20))
    levels = HashLevels(levels=2, entries=8, coarsest=2, finest=3)
    table = table[: levels.rows].requires_grad_()
    assert torch.autograd.gradcheck(lambda t: definition.encode(points, t, levels), table)


@pytest.mark.parametrize("n", [0, 1, 31, 700])
def test_features(n):
    points, table = scene(max(n, 8))
    features = encode(points[:n], table, SMALL)
    expected = definition.encode(points[:n].double(), table.double(), SMALL)
    # float32 places of up to 50 cells: 50 * 2^-23 of differences of rows of about 3
    torch.testing.assert_close(features.double(), expected, atol=1e-4, rtol=1e-5)


def test_gradient():
    points, table = scene()
    given = torch.randn(len(points), SMALL.width, generator=torch.Generator().manual_seed(1))
    leaf, expected = (x.requires_grad_() for x in (table.clone(), table.double()))
    encode(points, leaf, SMALL).backward(given)
    definition.encode(points.double(), expected, SMALL).backward(given.double())
    torch.testing.assert_close(leaf.grad.double(), expected.grad, atol=1e-3, rtol=1e-4)


def test_threads():
    def everything():
        points, table = scene(40_000)
        features = encode(points, table.requires_grad_(), SMALL)
        return features.detach(), torch.autograd.grad(features.square().sum(), table)[0]

    require_same_bits(everything)


def test_levels_of_the_published_configuration():
    """16 levels of 2^19 entries from 16 to 4096 cells: 50.63 MB of the files that the paper counts."""
    levels = HashLevels()
    assert 2 * levels.rows == 12_657_696
    assert levels.resolutions[0] == 16
    assert levels.resolutions[-1] == 4096
    assert levels.width == 32


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"levels": 1}, "levels: expected 2 to 32, got 1"),
        ({"entries": 1000}, "entries: expected a power of two from 8 to 2\\^24, got 1000"),
        ({"coarsest": 9, "finest": 8}, "coarsest, finest: expected .* the coarsest first, got 9 and 8"),
    ],
)
def test_levels_that_cannot_be(values, message):
    with pytest.raises(ArgumentError, match=message):
        HashLevels(**values)


def test_errors():
    points, table = scene()
    with pytest.raises(ShapeError, match="points: expected"):
        encode(points.T, table, SMALL)
    with pytest.raises(ShapeError, match=f"table: expected \\[{SMALL.rows}, 2\\]"):
        encode(points, table[1:], SMALL)
    with pytest.raises(ArgumentError, match="points: not differentiable here"):
        encode(points.requires_grad_(), table, SMALL)
    with pytest.raises(ArgumentError, match="table: expected float32"):
        encode(points.detach(), table.double(), SMALL)
    with pytest.raises(DeviceError, match="points: expected a tensor on cpu, got meta"):
        encode(points.detach().to("meta"), table, SMALL)
