"""Voxels as a field: rendering, files, scenes of several."""

from dataclasses import replace

import pytest
import torch

from texgs.core.camera import orbit
from texgs.fields.part_edit import PartEdit
from texgs.fields.voxels import Voxels, VoxelScene, merge_grids
from texgs.raster.voxel_grid import interpolate_rows, pack_rows, unpack_rows, voxel_grid

CAMERA = orbit(30, 20, 4.0, 30.0, 48, 40)


def ball(center=(0.0, 0.0, 0.0), color=0.4, density=60.0, side=32, spacing=0.02, degree=1):
    """A ball of one colour in a lattice around it."""
    lower = torch.tensor(center) - 0.5 * spacing * (side - 1)
    steps = spacing * torch.arange(side) - 0.5 * spacing * (side - 1)
    distance = torch.stack(torch.meshgrid(steps, steps, steps, indexing="ij")).norm(dim=0)
    grid = voxel_grid(distance < 0.22, lower.tolist(), spacing, degree)
    near = (grid.points() - torch.tensor(center)).norm(dim=1) < 0.18
    sh = torch.zeros(len(grid), (degree + 1) ** 2, 3)
    sh[:, 0] = color
    rows = torch.cat([grid.rows[:1], pack_rows(density * near.float(), sh)])
    return Voxels(grid.with_rows(rows), metadata={"tf": "TF01"})


def test_two_apart_are_seen_as_each_alone():
    left, right = ball((-0.4, 0.0, 0.0)), ball((0.4, 0.0, 0.0), color=-0.8)
    together = VoxelScene([left, right]).render(CAMERA, outputs=("depth",))
    alone = [field.render(CAMERA) for field in (left, right)]
    expected = alone[0].alpha + alone[1].alpha
    assert (together.alpha - expected).abs().mean() < 2e-3, "they are interpolated, but for the first one"
    assert together.alpha.max() > 0.9
    assert (together.color - (alone[0].color + alone[1].color - 1)).abs().mean() < 2e-3


def test_densities_add_up_where_grids_overlap():
    one, other = ball(density=10.0, color=1.0), ball(density=30.0, color=-1.0)
    grid = merge_grids([one.grid, other.grid])
    density, sh = unpack_rows(grid.rows)
    inside = grid.points().norm(dim=1) < 0.1
    torch.testing.assert_close(density[1:][inside], torch.full_like(density[1:][inside], 40.0))
    torch.testing.assert_close(sh[1:, 0][inside], torch.full_like(sh[1:, 0][inside], -0.5))


def noise(seed=0, side=16, degree=1):
    """Densities of both signs in a lattice whose places are exact in binary."""
    generator = torch.Generator().manual_seed(seed)
    mask = torch.rand([side] * 3, generator=generator) < 0.7
    grid = voxel_grid(mask, (-0.25, -0.25, -0.25), 1 / 32, degree)
    density = 30 * torch.randn(len(grid), generator=generator)
    sh = torch.randn(len(grid), (degree + 1) ** 2, 3, generator=generator)
    return Voxels(grid.with_rows(torch.cat([grid.rows[:1], pack_rows(density, sh)])))


@pytest.mark.parametrize("order", [1, -1])
def test_an_empty_grid_changes_nothing(order):
    field = noise()
    empty = replace(field, grid=field.grid.with_rows(torch.zeros_like(field.grid.rows)))
    whole = VoxelScene([field, empty][::order]).render(CAMERA, outputs=("depth",))
    alone = field.render(CAMERA, outputs=("depth",))
    assert alone.alpha.max() > 0.5
    assert torch.equal(whole.alpha, alone.alpha)
    # Colours are multiplied by their weight and divided by it again.
    torch.testing.assert_close(whole.color, alone.color, atol=1e-6, rtol=0)


def test_a_negative_density_takes_nothing_from_another_grid():
    grids = [noise(seed).grid for seed in range(3)]
    whole = merge_grids(grids)
    density = torch.stack([unpack_rows(interpolate_rows(grid, whole.points()))[0] for grid in grids])
    positive = density.clamp_min(0).sum(0)
    expected = torch.where(positive > 0, positive, density.amin(0))
    torch.testing.assert_close(whole.density[1:], expected)


def test_the_lattice_of_equal_lattices_is_theirs():
    """Sides are multiples of eight, and a lattice of 1024 voxels has no room for rounding."""
    generator = torch.Generator().manual_seed(0)
    for spacing in torch.linspace(0.01, 0.1, 20).tolist():
        lower = torch.randn(3, generator=generator).tolist()
        grid = voxel_grid(torch.ones(8, 64, 16, dtype=torch.bool), lower, spacing, 0)
        assert merge_grids([grid, grid]).size == grid.size


@pytest.mark.parametrize("ratio", [1.5, 2.0, 3.0, 5.0])
@pytest.mark.parametrize("is_visible", [True, False])
def test_a_finer_grid_leaves_no_holes_in_a_coarse_one(ratio, is_visible):
    """In a block of one density, interpolation is exact at any spacing but at its faces."""

    def block(half, density):
        mask = torch.ones(16, 16, 16, dtype=torch.bool)
        grid = voxel_grid(mask, [-half] * 3, 2 * half / 15, 0)
        rows = pack_rows(torch.full((len(grid),), density), torch.zeros(len(grid), 1, 3))
        return Voxels(grid.with_rows(torch.cat([grid.rows[:1], rows])))

    coarse, fine = block(0.6, 3.0), block(0.6 / ratio, 1e-3)
    edits = [PartEdit(), PartEdit(visible=is_visible)]
    together = VoxelScene([coarse, fine]).render(CAMERA, edits=edits).alpha
    alone = coarse.render(CAMERA).alpha
    torch.testing.assert_close(together[18:22, 22:26], alone[18:22, 22:26], atol=0.03, rtol=0)


def test_a_merged_lattice_has_at_most_1024_voxels_a_side():
    long = voxel_grid(torch.ones(256, 8, 8, dtype=torch.bool), [0.0] * 3, 0.1, 0)
    fine = voxel_grid(torch.ones(8, 8, 8, dtype=torch.bool), [0.0] * 3, 0.02, 0)
    whole = merge_grids([long, fine])
    assert max(whole.size) == 1024
    assert whole.spacing == pytest.approx(25.5 / 1023)


def test_merging_makes_no_tensor_on_another_device_than_the_rows():
    grids = [noise(seed).grid for seed in range(2)]
    expected = merge_grids(grids)
    with torch.device("meta"):  # where tensors are made that name no device
        assert torch.equal(merge_grids(grids).rows, expected.rows)


def test_edits_of_opacity_and_visibility():
    fields = [ball((-0.4, 0.0, 0.0), density=8.0), ball((0.4, 0.0, 0.0), density=8.0)]
    scene = VoxelScene(fields)
    hidden = scene.render(CAMERA, edits=[PartEdit(visible=False), PartEdit()])
    assert (hidden.alpha - fields[1].render(CAMERA).alpha).abs().max() < 0.2
    thin = VoxelScene(fields[:1]).render(CAMERA, edits=[PartEdit(opacity=0.5)]).alpha
    density, sh = unpack_rows(fields[0].grid.rows)
    exact = fields[0].grid.with_rows(pack_rows(0.5 * density, sh))
    assert torch.equal(thin, replace(fields[0], grid=exact).render(CAMERA).alpha)
