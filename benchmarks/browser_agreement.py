"""The page of `texgs export --to scene.html` against `texgs render`: pictures in a real browser, and bytes.

`python -m benchmarks.browser_agreement SCENE OUTPUT.json` takes a scene of surfels. Every row compares a view
with the rasterizer twice: for the numbers in the page, and for the scene as it is, which the page rounds.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks import machine
from benchmarks.command import call
from tests.viewer.browser import browser
from tests.viewer.drawing import composed_of, drawn, open_renderer
from texgs.core.camera import Camera, orbit
from texgs.core.device import torch_device
from texgs.core.lens import Lens
from texgs.core.light import HEADLIGHT, Light
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.compact import write_compact
from texgs.fields.surfels.composition import Composition
from texgs.scene.frame import frame
from texgs.scene.scene import Scene, SceneSegment
from texgs.scene.scene_file import read_scene
from texgs.scene.segment_file import write_segment
from texgs.viewer.description import describe, describe_light
from texgs.viewer.packing import pack
from texgs.viewer.standalone import write_page

SIZE = 400  # pixels of either side
NEVER = 1e-12  # light left at which a pixel ends that does not end early
ANGLES = (
    (30, 20, 1.0),
    (-100, 5, 1.0),
    (200, 60, 0.7),
    (100, -35, 0.5),
    (0, 90, 1.3),
)  # and part of the distance
LIGHTS = {"headlight": HEADLIGHT, "from the side": Light("directional", 100, 30)}
EDITS = {
    "none": {},
    "palettes": {"palette": (0.16, 0.62, 0.56)},
    "opacity 0.3": {"opacity": 0.3},
    "opacity 5": {"opacity": 5.0},
    "material": {"ambient": 0.5, "diffuse": 1.5, "specular": 3.0, "shininess": 0.5},
}


def main(source: str, output: str) -> None:
    """Compare all views; write the file."""
    with TemporaryDirectory() as folder:
        scene = with_segment(read_scene(source), Path(folder))
        rows = list(comparisons(scene, Path(folder)))
        report = {
            "machine": machine.describe(torch_device("cpu")),
            "scene": Path(source).name,
            "surfels": len(scene.open()),
            "bytes": sizes(scene, Path(folder)),
            "pixels": [SIZE, SIZE],
            "rows": rows,
        }
    Path(output).write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")


def with_segment(scene: Scene, folder: Path) -> Scene:
    """The scene with the upper half of its first model as a segment of another colour."""
    name, entry = next(iter(scene.models.items()))
    model, _ = replace(entry, segments={}).surfels()
    above = model.parameters["means"][:, 1] > 0
    file = write_segment(folder / "upper.segment", model, above, {})
    segments = {"upper": SceneSegment(file, PartEdit(palette=(0.8, 0.2, 0.3)), entry.texture)}
    return replace(scene, models={**scene.models, name: replace(entry, segments=segments)})


def comparisons(scene: Scene, folder: Path) -> Iterator[dict[str, Any]]:
    """A row for each edit, light and camera."""
    composed = scene.open()
    assert isinstance(composed, Composition)
    packed = pack(folder / "page.html", composed)
    rounded, description = composed_of(packed), describe("scene", scene, composed)
    endless = composed_of(packed)
    endless.options = replace(endless.options, transmittance_min=NEVER)
    with browser() as launched:
        page = launched.new_page()
        open_renderer(page, packed, description)
        for edit, changed in EDITS.items():
            edits = [replace(each, **changed) for each in scene.edits]
            for light_name, light in LIGHTS.items():
                for angles in ANGLES:
                    camera = camera_of(angles)
                    shown = drawn(page, camera, edited(description, edits, light)).astype(int)
                    seen = (camera, light, edits)
                    early = rounded.render(*seen).alpha != endless.render(*seen).alpha
                    same = frame(rounded, *seen, background=scene.background)
                    exact = frame(composed, *seen, background=scene.background)
                    row = {"edit": edit, "light": light_name, "camera": list(angles)}
                    row |= measures(np.abs(shown - same).max(2), early.numpy())
                    row |= rounding(np.abs(shown - exact))
                    print(row, flush=True)
                    yield row


def measures(difference: np.ndarray, early: np.ndarray) -> dict[str, Any]:
    """Levels of 255 by which pixels [H, W] differ at most, where they end early and elsewhere."""
    return {
        "pixels that end early": float(early.mean()),
        "largest there": int(difference[early].max(initial=0)),
        "largest elsewhere": int(difference[~early].max(initial=0)),
        "pixels that differ": float((difference > 0).mean()),
    }


def rounding(difference: np.ndarray) -> dict[str, Any]:
    """How far channels [H, W, 3] are from those of the scene before it was rounded, levels of 255."""
    return {
        "rounded, largest": int(difference.max()),
        "rounded, pixels beyond 3": float((difference.max(2) > 3).mean()),
        "rounded, PSNR": float(-10 * np.log10(max(np.square(difference / 255).mean(), 1e-12))),
    }


def camera_of(angles: tuple[float, float, float]) -> Camera:
    """A square view of the origin."""
    azimuth, polar, part = angles
    lens = Lens().square(SIZE)
    return orbit(azimuth, polar, part * lens.radius, lens.fov_y, lens.width, lens.height)


def edited(description: dict[str, Any], edits: list[PartEdit], light: Light) -> dict[str, Any]:
    """The description of the scene with other edits and another light."""
    changed = json.loads(json.dumps(description)) | {"light": describe_light(light)}
    parts = [part for model in changed["models"] for part in (model, *model["segments"])]
    for part, edit in zip(parts, edits, strict=True):
        part["edit"] = asdict(edit)
    return changed


def sizes(scene: Scene, folder: Path) -> dict[str, Any]:
    """Bytes of the page and of the compact files of its models."""
    page = write_page(folder / "scene.html", scene, "scene").path.stat().st_size
    files = [
        write_compact(folder / f"{i}.texgs", m.surfels()[0]) for i, m in enumerate(scene.models.values())
    ]
    compact = sum(file.stat().st_size for file in files)
    return {"page": page, "compact files": compact, "ratio": page / compact}


if __name__ == "__main__":
    call(main)
