"""The definition of hash encoding against plain loops, and the levels that the paper has."""

import pytest
import torch

from tests.raster.operations import LEVELS, points
from tests.refusals import refused
from texgs.raster.hash_encoding import HashLevels, encode
from texgs.raster.reference import voxels as definition


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
    given = {name: x.double() for name, x in points(60).items()}
    rows = given["table"].tolist()
    expected = torch.tensor(
        [looped(point, rows, LEVELS) for point in given["points"].tolist()], dtype=torch.float64
    )
    torch.testing.assert_close(definition.encode(**given, levels=LEVELS), expected)


def test_levels_of_the_published_configuration():
    """16 levels of 2^19 entries from 16 to 4096 cells: 50.63 MB of the files that the paper counts."""
    levels = HashLevels()
    assert 2 * levels.rows == 12_657_696
    assert levels.resolutions[0] == 16
    assert levels.resolutions[-1] == 4096
    assert levels.width == 32


@pytest.mark.parametrize("values", [{"levels": 1}, {"entries": 1000}, {"coarsest": 9, "finest": 8}])
def test_levels_that_cannot_be(values):
    refused(lambda: HashLevels(**values), ", ".join(values))


@pytest.mark.parametrize("axis", range(3))
def test_a_point_that_is_not_a_number_is_seen(axis):
    spoiled = points(4)
    spoiled["points"][1, axis] = float("nan")
    features = encode(**spoiled, levels=LEVELS)
    assert features.isnan().any(dim=1).tolist() == [False, True, False, False]
