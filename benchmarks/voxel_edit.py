"""Compare a step of an edit of fitted voxel grids between two builds of the CPU library, in turns.

`python -m benchmarks.voxel_edit BEFORE.so AFTER.so JSON GRID VIEWS [GRID VIEWS ...]` takes files of voxels
and the views that they were fitted to. Each visit is a process with `OMP_NUM_THREADS` threads.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections import defaultdict
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

import torch

from benchmarks import machine
from benchmarks.command import call
from texgs.core.camera import Camera
from texgs.fields.voxels.file import read_voxels
from texgs.raster import native
from texgs.raster.voxel_grid import VoxelGrid, pack_rows, unpack_rows
from texgs.raster.voxel_optimizer import VoxelOptimizer, VoxelRates
from texgs.raster.voxels import March, Rays, Samples, camera_rays
from texgs.volume.images import load
from texgs.volume.view_set import read_views

SIZE = 400  # pixels
ROUNDS, RUNS, EVERY = 2, 2, 90  # visits, timed steps of a view, and which test views
VISIT = "import sys; from benchmarks.voxel_edit import tell; tell(*sys.argv[1:])"
PHASES = ("render", "gradient", "optimiser")
RATES = VoxelRates(*[1e-12] * 3)  # the grid stays as it is


def main(before: str, after: str, path: str, *scenes: str) -> None:
    """Alternate between the builds; write medians of milliseconds and their ratio."""
    report: dict[str, Any] = {"machine": machine.describe(torch.device("cpu"))}
    taken: dict[tuple[str, str, int], dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    for _ in range(ROUNDS):
        for grid, views in zip(scenes[::2], scenes[1::2], strict=True):
            for build, library in (("before", before), ("after", after)):
                for degree, phases in visit(library, grid, views).items():
                    for name, values in phases.items():
                        taken[Path(grid).stem, name, int(degree)][build] += values
    rows = [
        {"grid": grid, "phase": name, "degree": degree, "n": len(builds["after"])}
        | {f"{build}_ms": median(values) for build, values in builds.items()}
        | {"ratio": median(builds["after"]) / median(builds["before"])}
        for (grid, name, degree), builds in taken.items()
    ]
    report |= {"size": SIZE, "rows": rows}
    Path(path).write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")


def visit(library: str, grid: str, views: str) -> dict[str, dict[str, list[float]]]:
    """Milliseconds by degree and phase, measured in a process of its own."""
    command = [sys.executable, "-c", VISIT, library, grid, views]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def tell(*words: str) -> None:
    """Print what a visit has measured."""
    print(json.dumps(measure(*words)))


def measure(library: str, path: str, views: str) -> dict[int, dict[str, list[float]]]:
    """The same with one build of the library."""
    native.library_path = lambda device_type="cpu": Path(library)
    native._require_own_sources = lambda lib: None  # the build before has other sources
    test = read_views(views).test[::EVERY]
    factor = test[0].load().shape[1] // SIZE
    cameras = load(test, reduce=factor).cameras
    field = read_voxels(path)
    return {degree: steps(at_degree(field.grid, degree), field.march, cameras) for degree in (2, 1, 0)}


def at_degree(grid: VoxelGrid, degree: int) -> VoxelGrid:
    """The grid without its higher harmonics."""
    density, sh = unpack_rows(grid.rows)
    return grid.with_rows(pack_rows(density, sh[:, : (degree + 1) ** 2]))


def steps(grid: VoxelGrid, march: March, cameras: list[Camera]) -> dict[str, list[float]]:
    """Milliseconds of each phase of the timed steps."""
    optimizer = VoxelOptimizer(grid)
    taken: dict[str, list[float]] = defaultdict(list)
    for camera in cameras:
        for run in range(RUNS + 1):
            clock = [perf_counter()]
            rays = camera_rays(camera).flatten(0, 1)
            out = Rays(rays.new_empty(len(rays), 3), *rays.new_empty(2, len(rays)))
            samples = Samples(grid, march, rays, out)
            clock.append(perf_counter())
            samples.add_gradient(torch.full_like(out.color, 1e-6), None, optimizer.gradient)
            clock.append(perf_counter())
            optimizer.step(RATES)
            clock.append(perf_counter())
            if run:  # the first one warms up
                for name, begin, end in zip(PHASES, clock[:-1], clock[1:], strict=True):
                    taken[name].append(1e3 * (end - begin))
                taken["step of an edit"].append(1e3 * (clock[-1] - clock[0]))
    return taken


if __name__ == "__main__":
    call(main)
