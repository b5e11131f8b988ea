"""Sizes of the paper's two tables, in MB, from the numbers of primitives that stand beside them."""

import pytest
import torch

from texgs.core.memory import MIB
from texgs.fields.gaussians.model import Gaussians
from texgs.fields.surfels import groups
from texgs.fields.voxels.model import Voxels
from texgs.raster.voxel_grid import VoxelGrid

SCENES = 1.75  # basic scenes of a data set, on average: seven of four data sets
LATTICE = 512  # of Plenoxels


def megabytes(sizes):
    return sizes["total_mib"] * MIB / 1e6


def gaussians(count):
    """So many 3D Gaussians of degree 3, all at one address."""
    shapes = {"means": (3,), "quats": (4,), "scales": (3,), "opacities": (), "sh": (16, 3)}
    return Gaussians({name: torch.zeros(1).expand(count, *shape) for name, shape in shapes.items()})


def voxels(count, degree):
    """So many voxels in the paper's lattice; blocks and rows all at one address."""
    blocks = torch.zeros(1, dtype=torch.int64).expand(*[LATTICE // 4] * 3)
    rows = torch.zeros(1).expand(count + 1, {0: 4, 2: 32}[degree])
    return Voxels(VoxelGrid((0.0, 0.0, 0.0), 1.0, blocks, blocks, rows, rows[:, 0], blocks, blocks))


@pytest.mark.parametrize(
    ("method", "count", "published"),
    [("StyleSplat", 357_090, 89), ("Instruct-GS2GS", 231_189, 57), ("DGE", 351_917, 87)],
)
def test_gaussians(method, count, published):
    assert round(megabytes(gaussians(count).sizes())) == published


@pytest.mark.parametrize(
    ("method", "degree", "published"), [("ARF, without direction", 0, 975), ("IN2N", 2, 1150)]
)
def test_voxels_of_both_rows_are_as_many(method, degree, published):
    """The paper does not tell how many: two million explain both rows, and the rest is the index."""
    size = SCENES * megabytes(voxels(2_050_000, degree).sizes())
    assert size == pytest.approx(published, rel=0.005)
    index = SCENES * megabytes(voxels(0, degree).sizes())
    assert index == pytest.approx(SCENES * 4 * LATTICE**3 / 1e6)


@pytest.mark.parametrize(("table", "count", "published"), [("image", 129_857, 223), ("text", 108_119, 221)])
def test_textured_surfels(table, count, published):
    """The paper's two tables have the authors' files: 44 bytes of a surfel beside what its breakdown counts.

    Those are three floats of a normal, two of a mapping, three integers of its size and two mappings again.
    """
    columns = {"means": (3,), "quats": (4,), "scales": (2,), "opacities": ()}
    columns |= dict.fromkeys(("ambient", "diffuse", "specular", "shininess"), ())
    tensors = {name: torch.zeros(1).expand(count, *shape) for name, shape in columns.items()}
    tensors["texels"] = torch.zeros(1).expand(round(SCENES * 10_000_000), 3)
    assert round(megabytes(groups.sizes(tensors)) + 44 * count / 1e6) == published
