"""Sizes of the paper's tables, in MB or MiB, from the numbers of primitives that stand beside them."""

import pytest
import torch

from tests.fields.palette.test_palette import box
from tests.fields.surfels.samples import STAGES, sample
from tests.report.written import lines
from texgs.core.memory import MIB
from texgs.fields.gaussians import Gaussians
from texgs.fields.palette.model import PaletteField
from texgs.fields.palette.networks import network_shapes
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.model_file import write_model
from texgs.fields.voxels import Voxels
from texgs.raster.hash_encoding import HashLevels
from texgs.raster.voxel_grid import VoxelGrid

SCENES = 1.75  # basic scenes of a data set, on average: seven of four data sets
LATTICE = 512  # of Plenoxels
N_TEXELS = 10_000_000  # per basic scene, found by a bisection of 0.1 %


def megabytes(mib):
    return mib * MIB / 1e6


def surfels(count, texels):
    """So many textured surfels, all at one address."""
    p = {name: x[:1] for name, x in sample("texture", n=1).parameters.items()}
    texture = {"palette": torch.zeros(3), "texels": p.pop("texels").expand(texels, 3)}
    return Surfels({**{name: x.expand(count, *x.shape[1:]) for name, x in p.items()}, **texture})


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
    assert round(megabytes(gaussians(count).sizes()["total_mib"])) == published


@pytest.mark.parametrize(
    ("method", "degree", "published"), [("ARF, without direction", 0, 975), ("IN2N", 2, 1150)]
)
def test_voxels_of_both_rows_are_as_many(method, degree, published):
    """The paper does not tell how many: two million explain both rows, and the rest is the index."""
    size = SCENES * megabytes(voxels(2_050_000, degree).sizes()["total_mib"])
    assert size == pytest.approx(published, rel=0.005)
    index = SCENES * megabytes(voxels(0, degree).sizes()["total_mib"])
    assert index == pytest.approx(SCENES * 4 * LATTICE**3 / 1e6)


def test_the_full_configuration_of_a_palette_field():
    """168.67 MB: three hash grids and two lattices of 128^3; the paper's table has 168."""
    shapes = network_shapes(HashLevels(), 2)
    field = PaletteField(box().geometry, {name: torch.zeros(1).expand(s) for name, s in shapes.items()})
    assert megabytes(field.sizes()["total_mib"]) == pytest.approx(168.67, abs=0.005)


@pytest.mark.parametrize("line", lines("model_size"), ids=lambda line: line["dataset"])
def test_the_breakdown_of_surfels(line):
    by_group = surfels(int(line["primitives"]), int(line["basic_scenes"]) * N_TEXELS).sizes()
    assert round(by_group["geometry_mib"], 1) == line["geometry_mib"]
    assert round(by_group["shading_mib"], 1) == line["shading_mib"]
    assert by_group["texture_mib"] == pytest.approx(line["texture_mib"], rel=1e-3)
    total = sum(line[f"{group}_mib"] for group in ("geometry", "shading", "texture"))
    assert by_group["total_mib"] == pytest.approx(total, rel=1e-3)


@pytest.mark.parametrize(("table", "count", "published"), [("image", 129_857, 223), ("text", 108_119, 221)])
def test_the_papers_two_tables_have_the_authors_files(table, count, published):
    """44 bytes of a surfel beside what its breakdown counts, on average over the data sets.

    Those are three floats of a normal, two of a mapping, three integers of its size and two mappings again.
    """
    sizes = surfels(count, round(SCENES * N_TEXELS)).sizes()
    assert round(megabytes(sizes["files_mib"])) == published
    assert sizes["files_mib"] == pytest.approx(sizes["total_mib"] + 44 * count / MIB)


@pytest.mark.parametrize("stage", STAGES)
def test_stored_is_the_file_without_its_header(tmp_path, stage):
    model = sample(stage, n=500)
    data = write_model(tmp_path / "m", model).read_bytes()
    header = 8 + int.from_bytes(data[:8], "little")
    by_group = model.sizes()
    assert by_group["stored_total_mib"] * MIB == pytest.approx(len(data) - header, abs=1e-6)
    groups = ("stored_geometry_mib", "stored_shading_mib", "stored_texture_mib")
    assert by_group["stored_total_mib"] == pytest.approx(sum(by_group[group] for group in groups))
    assert header < 2048
