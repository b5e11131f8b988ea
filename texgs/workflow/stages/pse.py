"""Stage `pse`: the photorealistic edits of the paper's figure, beside the same edits of the volume."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING, Any

from texgs.core.progress import progress
from texgs.fields.kinds import kinds
from texgs.report.results import Comparison, PseResult
from texgs.workflow.inputs import has_scene, scene_and_volume
from texgs.workflow.stage import Outcome, Rule, Stage
from texgs.workflow.stages.settings import OfScene

if TYPE_CHECKING:
    import numpy as np

    from texgs.core.camera import Camera
    from texgs.fields.field import Composed
    from texgs.scene.scene import Scene
    from texgs.scene.twin import Twin

PICTURES = {
    "pse.png": "Edits of opacity, colour and light, each on top of those before it",
    "relight.png": "A light in front that moves from below to above, by its azimuth and polar angle",
}
BELOW = "; below each the volume with the same edit, and the error of the worst channel, four times enlarged."
COMPARED = 3  # views around the object, one of which is shown
CHECKED = 39  # views with lights and edits at random
POLAR = 20.0  # of these views, degrees
LEFT = (-150.0, 20.0)  # azimuth and polar angle of a light, degrees
SWEEP = (-30.0, -15.0, 0.0, 15.0, 30.0, 45.0)  # polar angles of the light in the paper's figure, degrees


def work(settings: OfScene, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write a scene file for each edit, pse.png and relight.png, and a check if there is a volume.

    It reads `scene`, the scene.yaml, with what it names.
    """
    from texgs.core.check import torch_device
    from texgs.core.figures import write_grid
    from texgs.report.check import check
    from texgs.scene.scene_file import read_scene, write_scene
    from texgs.scene.twin import Twin
    from texgs.volume.cameras import orbit_path

    scene = read_scene(inputs["scene"])
    device = torch_device(settings.fit.device)
    composition, twin = scene.open(device), None if scene.volume is None else Twin(scene, device)
    cameras = orbit_path(COMPARED, POLAR, settings.views.lens(scene.frame))
    can = kinds()[settings.fit.field].can
    groups = {"pse": chain(scene, composition.palettes, can), "relight": light_sweep(scene)}
    done: dict[str, list[Comparison]] = {group: [] for group in groups}
    for group, scenes in groups.items():
        rows: dict[str, list[np.ndarray]] = {}
        steps = progress(scenes.items(), len(scenes), title=f"{settings.dataset}: {group}", unit="edit")
        for title, changed in steps:
            write_scene(output / f"{group}-{len(done[group])}.yaml", changed)
            comparison, shown = compared(title, changed, composition, twin, cameras)
            done[group].append(comparison)
            for name, image in shown.items():
                rows.setdefault(name, []).append(image)
        write_grid(output / f"{group}.png", rows, [caption(entry) for entry in done[group]])
    captions, checked = {name: words + (BELOW if twin else ".") for name, words in PICTURES.items()}, None
    if twin is not None:
        words = CHECKED, settings.fit.seed, output / "check.json"
        checked = check(scene, composition, twin, settings.views.lens(scene.frame), *words)
        captions["check.png"] = f"{checked.sentence} The worst of {CHECKED}."
    return Outcome(PseResult(COMPARED, done["pse"], done["relight"], checked), captions)


def chain(scene: Scene, fitted: Sequence[tuple[float, ...]], can: Collection[str]) -> dict[str, Scene]:
    """Return the scenes of the paper's figure by title: opacity, colour, strength and direction of the light.

    Each is on top of those before it. What fields of a kind cannot do is left out, but for the direction of
    the light: without shading it changes nothing.
    """
    from texgs.core.light import Light

    names, steps = list(scene.models), {"as fitted": scene}
    changes: list[tuple[str, Mapping[str, Mapping[str, Any]]]] = [
        (f"+ opacity of {names[0]} x 0.4", {names[0]: {"opacity": 0.4}})
    ]
    if "palette" in can:
        turned = {name: {"palette": (b, r, g)} for name, (r, g, b) in zip(names, fitted, strict=True)}
        changes.append(("+ other colours", turned))
    if "relight" in can:
        magnitude = {"ambient": 0.7, "diffuse": 1.2, "specular": 2.0}
        changes.append(("+ k_a x 0.7, k_d x 1.2, k_s x 2", dict.fromkeys(names, magnitude)))
    for title, change in changes:
        scene = steps[title] = edited(scene, change)
    return {**steps, "+ light from the left": replace(scene, light=Light("directional", *LEFT))}


def light_sweep(scene: Scene) -> dict[str, Scene]:
    """Return the scene under a light that moves from below the object to above it, by title."""
    from texgs.core.light import Light

    return {
        f"light at (-90°, {polar:g}°)": replace(scene, light=Light("directional", -90.0, polar))
        for polar in SWEEP
    }


def edited(scene: Scene, changes: Mapping[str, Mapping[str, Any]]) -> Scene:
    """Return the scene with edits of some models changed."""
    from texgs.scene.session import Session

    session = Session(scene)
    for part, values in changes.items():
        for key, value in values.items():
            session.set(part, key, value)
    return session.scene


def compared(
    title: str, scene: Scene, composition: Composed, twin: Twin | None, cameras: Sequence[Camera]
) -> tuple[Comparison, dict[str, np.ndarray]]:
    """Return PSNR and SSIM against the volume over some views, and all pictures [H, W, 3] of the first."""
    from texgs.metrics.quality import compare
    from texgs.report.beside_volume import pictures
    from texgs.scene.cut_view import beside
    from texgs.scene.frame import frame

    scores = defaultdict[str, list[float]](list)
    if twin is None:
        picture = frame(composition, cameras[0], scene)
        return Comparison(title), {"scene": picture}
    shown: dict[str, np.ndarray] = {}
    for camera in cameras:
        seen = beside(composition, camera, scene, twin)
        shown = shown or pictures(*seen)
        for name, value in compare(*seen).items():
            scores[name].append(value)
    means = {name: fmean(values) for name, values in scores.items()}
    return Comparison(title, **means), shown


def caption(entry: Comparison) -> str:
    """Return the title of a picture, with the mean PSNR of all views where it was measured."""
    measured = "" if entry.psnr is None else f"\nmean of {COMPARED} views: {entry.psnr:.1f} dB"
    return entry.title + measured


STAGE = Stage(
    "pse",
    order=130,
    help="edit colours, opacities and lights of a scene beside those of its volume",
    rule=Rule(
        "pse",
        "{dataset}/scene/{fit}/pse",
        ("pse.png", "relight.png"),
        target="scenes",
        gpu=("fit",),
        shown={name: f"{words}." for name, words in PICTURES.items()},
    ),
    inputs=scene_and_volume,
    work=work,
    applies=has_scene,
)
