"""What shadows and occlusion of a scene and of its volume cost: milliseconds, ratios of frames, and bytes.

`python -m benchmarks.light_speed OUTPUT.json SCENE` measures a scene with a volume at 400x400. Frames with
and without shadows take turns, and their lights rest; what a new light takes is told beside.
"""

import json
from collections.abc import Callable
from dataclasses import asdict, replace
from functools import partial
from itertools import count
from pathlib import Path

import torch

from benchmarks import machine, report
from benchmarks.command import call
from benchmarks.report import Measurement, Section
from benchmarks.settings import ROUNDS
from benchmarks.timing import Case, measure
from texgs.core.camera import Camera, orbit, orbit_direction
from texgs.core.light import Light
from texgs.fields.field import Composed
from texgs.scene.cut_view import cut_view
from texgs.scene.exposure import exposure_of
from texgs.scene.scene import Scene, volume_of
from texgs.scene.scene_file import read_scene
from texgs.scene.twin import Twin
from texgs.volume.caster import Caster
from texgs.volume.matter import Matter
from texgs.volume.nrrd_file import open_grid
from texgs.volume.overlay import overlays

SIZE = 400  # pixels of either side
LIGHTS = {
    "plain": Light("directional", 30.0, 40.0),
    "shadows": Light("directional", 30.0, 40.0, shadows=0.7),
    "shadows and occlusion": Light("directional", 30.0, 40.0, shadows=0.7, occlusion=0.5),
}


def main(output: str, source: str) -> None:
    """Measure a scene, print its times and write them."""
    scene, device = read_scene(source), torch.device("cpu")
    with machine.Load() as load:
        section = measured(scene, SIZE, ROUNDS)
    report.show(source, section)
    print(load)
    facts = {"machine": machine.describe(device), "load": asdict(load), "primitives": len(scene.open())}
    Path(output).write_text(json.dumps({**facts, **asdict(section)}, indent=1) + "\n")


def measured(scene: Scene, size: int, rounds: int) -> Section:
    """Return the times of a scene with a volume."""
    composed, twin = scene.open(), Twin(scene)
    camera = orbit(-60.0, 25.0, *scene.framed(composed).lens(width=size, height=size))
    cases = [
        *(
            Case(name, {"step": "once"}, {name: run})
            for name, run in steps(scene, composed, twin, camera).items()
        ),
        *frames(scene, composed, twin, camera, size),
    ]
    section = Section(measure(cases, rounds, torch.device("cpu"), "light"))
    section.add_ratios("light", "plain", ("volume", "scene"))
    section.measurements += memory(scene, composed, twin)
    return section


def steps(scene: Scene, composed: Composed, twin: Twin, camera: Camera) -> dict[str, Callable[[], object]]:
    """Return what is done when functions, a light or the reach change; each run has another one."""
    volume, numbers = volume_of(scene), count()
    caster = Caster(open_grid(volume.file), volume.appearance)
    tfs, unit = overlays(volume.tfs), volume.appearance.opacity_unit
    matter = twin.matter(scene, composed.palettes)

    def grid_of_a_light() -> None:
        matter.lit(orbit_direction(7.0 * next(numbers), 40.0), None)

    def turned() -> Scene:
        return replace(scene, light=replace(LIGHTS["shadows and occlusion"], azimuth=7.0 * next(numbers)))

    def changed() -> None:
        edited, factor = turned(), 1 - 1e-4 * next(numbers)
        models = {
            name: replace(each, edit=replace(each.edit, opacity=factor))
            for name, each in scene.models.items()
        }
        exposure_of(composed, replace(edited, models=models), twin)

    return {
        "extinction": partial(Matter, caster, tfs, unit),
        "grid of a light": grid_of_a_light,
        "changed opacity, all of it": changed,
        "new light, grid and surfels": lambda: exposure_of(composed, turned(), twin),
        "frame under a new light": lambda: cut_view(composed, camera, turned(), twin),
        "openness": lambda: matter.lit(None, 0.25 + 1e-6 * next(numbers)),
    }


def frames(scene: Scene, composed: Composed, twin: Twin, camera: Camera, size: int) -> list[Case]:
    """Return frames of the volume and of the scene under resting lights."""
    cases = []
    for name, light in LIGHTS.items():
        lit, where = replace(scene, light=light), {"size": size, "light": name}
        cases += [
            Case("volume", where, {"volume": partial(twin.render, camera, lit, composed.palettes)}),
            Case("scene", where, {"scene": partial(cut_view, composed, camera, lit, twin)}),
        ]
    return cases


def memory(scene: Scene, composed: Composed, twin: Twin) -> list[Measurement]:
    """Return the megabytes that stay: extinctions, the openness that lights begin with, and a light."""
    lit = replace(scene, light=LIGHTS["shadows and occlusion"])
    cells, matter = twin.light_cells(lit, composed.palettes), twin.matter(lit, composed.palettes)
    held = {"extinction": matter.extinction, "openness": cells.light, "a light": cells.light}
    return [Measurement.of(name, {"step": "held"}, "MB", [1e-6 * x.nbytes]) for name, x in held.items()]


if __name__ == "__main__":
    call(main, "texgs.volume.matter texgs.scene.exposure texgs.scene.twin texgs.volume.caster")
