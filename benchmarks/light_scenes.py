"""How close scenes are to their volumes with shadows and occlusion, beside how close they are without.

`python -m benchmarks.light_scenes OUTPUT.csv SCENE...` compares each scene with its volume from ten sides
under three lights each. Rows have the means of PSNR on the object, what is lost, and the largest loss.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pandas as pd

from benchmarks.command import call
from texgs.core.camera import Camera, orbit
from texgs.core.light import Light, random_lights
from texgs.core.progress import progress
from texgs.metrics.quality import compare
from texgs.scene.cut_view import scene_and_volume
from texgs.scene.scene import Scene
from texgs.scene.scene_file import read_scene
from texgs.scene.twin import Twin

SIZE, CAMERAS, LIGHTS, SEED = 400, 10, 3, 0  # pixels of either side; cameras with so many lights each
STRENGTHS = ((0.7, 0.5), (1.0, 1.0))  # shadows and occlusion


def main(output: str, *sources: str) -> None:
    """Compare scenes with their volumes, print and write a row for each scene and strength."""
    rows = [row for source in sources for row in compared(name_of(source), read_scene(source), SIZE)]
    table = pd.DataFrame(rows)
    print(table.round(2).to_string(index=False))
    table.round(3).to_csv(output, index=False, lineterminator="\n")


def name_of(source: str) -> str:
    """Return the data set of a scene file that a run wrote: DATASET/scene/FIT/compose/scene.yaml."""
    return Path(source).resolve().parts[-5]


def compared(name: str, scene: Scene, size: int) -> list[dict[str, object]]:
    """Return the rows of one scene."""
    composed, twin = scene.open(), Twin(scene)

    def on_object(camera: Camera, light: Light) -> float:
        return compare(*scene_and_volume(composed, camera, replace(scene, light=light), twin))["object_psnr"]

    views = list(seen_from(scene, size))
    plain = [on_object(*view) for view in progress(views, title=f"{name} without shadows", unit="view")]
    rows = []
    for shadows, occlusion in STRENGTHS:
        title = f"{name} with shadows {shadows:g}, occlusion {occlusion:g}"
        shaded = [
            on_object(camera, replace(light, shadows=shadows, occlusion=occlusion))
            for camera, light in progress(views, title=title, unit="view")
        ]
        both = pd.DataFrame({"without": plain, "with": shaded})
        loss = both["without"] - both["with"]
        means = {**both.mean(), "loss": loss.mean(), "largest loss": loss.max()}
        rows.append({"scene": name, "shadows": shadows, "occlusion": occlusion, **means})
    return rows


def seen_from(scene: Scene, size: int) -> Iterator[tuple[Camera, Light]]:
    """Yield cameras, each with several lights, all from directions that are alike likely."""
    lens = scene.framed().lens(width=size, height=size)
    for number, place in enumerate(random_lights(CAMERAS, SEED)):
        for light in random_lights(LIGHTS, SEED, 1 + number):
            yield orbit(place.azimuth, place.polar, *lens), light


if __name__ == "__main__":
    call(main, "texgs.volume.matter texgs.scene.exposure texgs.scene.twin texgs.volume.caster")
