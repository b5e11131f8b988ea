"""Slices of a volume, and clicks on scenes: milliseconds, equal samples, and distances to what is seen.

`python -m benchmarks.slices OUTPUT.json VOLUME.nii.gz SCENE...` draws slices of a volume at 512x512, of
random numbers in all planes, and compares all samples with those that nibabel reads. In scenes of `texgs run`
it compares points of clicks with where half of the light is gone in the volume, on opaque matter.
"""

import json
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import nibabel
import numpy as np
import torch

from benchmarks import machine, report
from benchmarks.command import call
from benchmarks.report import Measurement, Section
from benchmarks.settings import ROUNDS
from benchmarks.timing import Case, measure
from texgs.core.camera import orbit
from texgs.core.image import FAST_PNG
from texgs.scene.session import Session
from texgs.volume.grid import Grid
from texgs.volume.nrrd_file import open_grid
from texgs.volume.prepare import prepare
from texgs.volume.slices import SlicePlane, planes_of, slice_colors, slice_of, window_of
from texgs.volume.sources import open_source

SIZE = 512  # pixels of either side of a slice
VIEWS, VIEW_SIZE = 6, 200  # of a scene, and pixels of either side of these
APART = 20  # opaque pixels from one click to the next
OPAQUE = 0.99  # alpha of the volume from which on matter is opaque
SEED = 0


def main(output: str, volume: str, *scenes: str) -> None:
    """Measure, print and write."""
    with machine.Load() as load, TemporaryDirectory() as folder:
        prepare(open_source(Path(volume)), Path(folder, "volume.nrrd"), up="+z")
        section = drawn(open_grid(Path(folder, "volume.nrrd")), Path(volume), ROUNDS)
        for scene in map(Path, scenes):
            section.measurements += clicked(
                scene, scene.resolve().parents[3].name
            )  # DATASET/scene/FIT/compose
    report.show(volume, section)
    print(load)
    facts = {"machine": machine.describe(torch.device("cpu")), "load": asdict(load)}
    Path(output).write_text(json.dumps({**facts, **asdict(section)}, indent=1) + "\n")


def drawn(grid: Grid, file: Path, rounds: int) -> Section:
    """Return times of slices by planes, and the share of samples that are those of the file."""
    rng, name = np.random.default_rng(SEED), file.name.partition(".")[0]
    cases = [
        Case("slice", {"volume": name, "plane": plane.name}, {"slice": picture_of(grid, plane, rng)})
        for plane in planes_of(grid)
    ]
    section = Section(measure(cases, rounds, torch.device("cpu"), "slices"))
    for plane, expected in zip(planes_of(grid), slices_by_nibabel(file), strict=True):
        pairs = ((slice_of(grid, plane, number), each) for number, each in enumerate(expected))
        equal = [float(np.mean(seen == each)) for seen, each in pairs]
        section.measurements.append(Measurement.of("equal samples", {"plane": plane.name}, "1", equal))
    return section


def picture_of(grid: Grid, plane: SlicePlane, rng: np.random.Generator) -> Callable[[], bytes]:
    """Return what makes the PNG file of a slice of a random number, as a page asks for it."""

    def run() -> bytes:
        number = int(rng.integers(plane.count))
        colors = slice_colors(partial(slice_of, grid, plane, number), window_of(grid), {})
        picture = cv2.resize(colors, (SIZE, SIZE), interpolation=cv2.INTER_NEAREST_EXACT)
        return cv2.imencode(".png", picture, FAST_PNG)[1].tobytes()

    return run


def slices_by_nibabel(file: Path) -> list[np.ndarray]:
    """Return all slices [N, H, W] of each plane, of samples that nibabel turns to right, front and head."""
    values = np.asarray(nibabel.as_closest_canonical(nibabel.load(file)).dataobj)
    x, y, z = values[:, ::-1, ::-1], values[::-1, :, ::-1], values[::-1, ::-1]
    return [x.transpose(0, 2, 1), y.transpose(1, 2, 0), z.transpose(2, 1, 0)]


def clicked(file: Path, name: str) -> list[Measurement]:
    """Return how many voxels clicks on a scene, and its models, are from the median depth of its volume."""
    session = Session.open(file)
    scene, composed = session.scene, session.composition
    twin, rng = session.twin_of(scene), np.random.default_rng(SEED)
    apart: dict[str, list[float]] = {"clicks": [], "mean depth of models": []}
    for azimuth, polar in rng.uniform((-180, -60), (180, 60), (VIEWS, 2)).tolist():
        camera = orbit(azimuth, polar, *scene.framed(composed).lens().square(VIEW_SIZE))
        seen = twin.render(camera, scene, composed.palettes, outputs=("depth", "median"))
        models = composed.render(camera, scene.light, scene.edits, outputs=("depth",))
        places, shown = (camera.unproject(each).numpy() for each in (seen.median, models.depth))  # type: ignore[arg-type]
        pixels = np.argwhere((seen.alpha >= OPAQUE).numpy() & (seen.median > 0).numpy())  # type: ignore[operator]
        for row, column in pixels[::APART].tolist():
            click = session.point_at(camera, "shaded", scene, (column, row)) or [np.inf] * 3
            for way, point in zip(apart, (click, shown[row, column]), strict=True):
                apart[way].append(float(np.linalg.norm(point - places[row, column])))
    voxel, found = min(twin.grid.spacing) * twin.grid.scale, []
    for way, distances in apart.items():
        voxels, of = np.array(distances) / voxel, {"scene": name, "place": way}
        found += [
            Measurement.of("voxels apart", of, "1", voxels.tolist()),
            Measurement.of("share within a voxel", of, "1", [float((voxels <= 1).mean())]),
            Measurement.of("voxels apart, most", of, "1", [float(voxels.max())]),
        ]
    return found


if __name__ == "__main__":
    call(main, "texgs.volume.slices texgs.scene.session")
