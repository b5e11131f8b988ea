"""Stage `pse`: the photorealistic edits of the paper's figure, beside the same edits of the volume."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from texgs.core.progress import progress
from texgs.fields.kinds import kinds
from texgs.report.results import BELOW_WORDS, COMPARED_VIEWS, CheckResult, PseResult, ViewComparison
from texgs.workflow.inputs import has_scene, scene_and_volume
from texgs.workflow.stage import Outcome, Rule, Stage
from texgs.workflow.stages.settings import OfScene

if TYPE_CHECKING:
    import numpy as np

    from texgs.core.lens import Lens
    from texgs.fields.field import Composed
    from texgs.scene.scene import Scene
    from texgs.scene.twin import Twin

PICTURES = {
    "pse.png": "Edits of opacity, colour and light, each on top of those before it",
    "relight.png": "A light in front that moves from below to above, by its azimuth and polar angle",
}
LIGHT_WORDS = (
    "Light and shadow: the scene and its volume under lights by azimuth and polar angle, which matter hides. "
    "Above is the PSNR on the object, and that without shadows and occlusion."
)
CHECKED = 39  # views with lights and edits at random


def work(settings: OfScene, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write a scene file for each edit, pse.png and relight.png; with a volume a check and shadows.png.

    It reads `scene`, the scene.yaml, with what it names.
    """
    from texgs.core.check import torch_device
    from texgs.core.figures import write_grid
    from texgs.report.compared import POLAR, caption, chain, compare_views, light_sweep
    from texgs.scene.scene_file import read_scene, write_scene
    from texgs.scene.twin import Twin
    from texgs.volume.cameras import orbit_path

    scene = read_scene(inputs["scene"])
    lens = settings.views.lens(scene.frame)
    device = torch_device(settings.fit.device)
    composition, twin = scene.open(device), None if scene.volume is None else Twin(scene, device)
    cameras = orbit_path(COMPARED_VIEWS, POLAR, lens)
    can = kinds()[settings.fit.field].can
    groups = {"pse": chain(scene, composition.palettes, can), "relight": light_sweep(scene)}
    done: dict[str, list[ViewComparison]] = {group: [] for group in groups}
    for group, scenes in groups.items():
        rows: dict[str, list[np.ndarray]] = {}
        steps = progress(scenes.items(), len(scenes), title=f"{settings.dataset}: {group}", unit="edit")
        for title, changed in steps:
            write_scene(output / f"{group}-{len(done[group])}.yaml", changed)
            comparison, shown = compare_views(title, changed, composition, twin, cameras)
            done[group].append(comparison)
            for name, image in shown.items():
                rows.setdefault(name, []).append(image)
        write_grid(output / f"{group}.png", rows, [caption(entry) for entry in done[group]])
    captions = {name: words + (BELOW_WORDS if twin else ".") for name, words in PICTURES.items()}
    checked = None
    if twin is not None:
        checked, more = write_beside_volume(settings, (scene, composition, twin, lens), output)
        captions |= more
    return Outcome(PseResult(COMPARED_VIEWS, done["pse"], done["relight"], checked), captions)


def write_beside_volume(
    settings: OfScene, beside: tuple[Scene, Composed, Twin, Lens], output: Path
) -> tuple[CheckResult, dict[str, str]]:
    """Write a check, and shadows.png of what can be relit; return the check and words for pictures."""
    from texgs.report.check import check
    from texgs.report.compared import write_light_figure

    checked = check(*beside, CHECKED, settings.fit.seed, output / "check.json")
    captions = {"check.png": f"{checked.sentence} The worst of {CHECKED}."}
    if "relight" in kinds()[settings.fit.field].can:
        write_light_figure(output / "shadows.png", *beside)
        captions["shadows.png"] = LIGHT_WORDS
    return checked, captions


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
