"""A sparse voxel grid: whole views, a step of an edit, and a step of the fit with its parts."""

import torch

from benchmarks.report import Section
from benchmarks.scenes import camera
from benchmarks.settings import Settings
from benchmarks.timing import Case, measure
from texgs.raster.voxel_grid import VoxelGrid, drop_sh, pack_rows, voxel_grid
from texgs.raster.voxel_optimizer import VoxelOptimizer, VoxelRates
from texgs.raster.voxels import March, Rays, Samples, camera_rays, render_view

SIDE, FEW = 256, 64  # voxels along a side; the latter for --quick
RADIUS, THICKNESS = 0.8, 2.0  # of a sphere in a cube of side 2; of its shell, in voxels
RAYS = 8192
RATES = VoxelRates(*[1e-12] * 3)  # the grid stays as it is


def run(settings: Settings) -> Section:
    """Time them on the shell of a sphere, which is what is left of opaque matter."""
    grid = shell(FEW if settings.is_quick else SIDE).to(settings.device)
    cases = []
    for field in (grid, drop_sh(grid)):
        where = {"side": field.size[0], "voxels": len(field), "degree": field.degree}
        optimizer = VoxelOptimizer(field)
        for size in settings.sizes:
            cases += views(field, optimizer, size, {**where, "size": size}, settings.device)
        cases.append(fit_step(field, optimizer, {**where, "rays": RAYS}, settings.device))
    return Section(measure(cases, settings.rounds, settings.device, "voxels"))


def shell(side: int) -> VoxelGrid:
    """Voxels near a sphere, some of them dense, with random colours."""
    spacing = 2.0 / (side - 1)
    axis = torch.linspace(-1, 1, side)
    distance = (torch.stack(torch.meshgrid(axis, axis, axis, indexing="ij")).norm(dim=0) - RADIUS) / spacing
    mask = distance.abs() < THICKNESS + 1
    grid = voxel_grid(mask, (-1.0, -1.0, -1.0), spacing)
    generator = torch.Generator().manual_seed(0)
    depth = (grid.points().norm(dim=1) - RADIUS).abs() / spacing
    density = (THICKNESS - depth) / spacing
    sh = 0.2 * torch.randn(len(grid), 9, 3, generator=generator)
    return grid.with_rows(torch.cat([grid.rows[:1], pack_rows(density, sh)]))


def views(
    grid: VoxelGrid, optimizer: VoxelOptimizer, size: int, where: dict[str, object], device: torch.device
) -> list[Case]:
    """A view, and a step of an edit: the view, its gradient from a given one of the image, the optimiser."""
    seen = camera(size).to(device)
    rays = camera_rays(seen).flatten(0, 1)
    out = Rays(rays.new_empty(len(rays), 3), *rays.new_empty(2, len(rays)))
    upstream = torch.full_like(out.color, 1e-6)

    def view() -> None:
        with torch.no_grad():
            render_view(grid, seen)

    def edit() -> None:
        Samples(grid, March(), rays, out).add_gradient(upstream, None, optimizer.gradient)
        optimizer.step(RATES)

    return [Case("view", where, {"view": view}), Case("step of an edit", where, {"step of an edit": edit})]


def fit_step(
    grid: VoxelGrid, optimizer: VoxelOptimizer, where: dict[str, object], device: torch.device
) -> Case:
    """Random rays, which share no cache lines, and their gradient."""
    rays = camera_rays(camera(400)).flatten(0, 1)
    generator = torch.Generator().manual_seed(1)
    rays = rays[torch.randint(len(rays), (RAYS,), generator=generator)].to(device)
    out = Rays(rays.new_empty(RAYS, 3), *rays.new_empty(2, RAYS))
    upstream = torch.full_like(out.color, 1e-6)
    kept: list[Samples] = []

    def march() -> None:
        kept[:] = [Samples(grid, March(), rays, out)]

    return Case(
        "step of a fit",
        where,
        {
            "march": march,
            "gather": lambda: kept[0].add_gradient(upstream, None, optimizer.gradient),
            "optimiser": lambda: optimizer.step(RATES),
        },
    )
