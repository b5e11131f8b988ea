"""Check a scene against its volume: over seeded views, lights and edits, with a floor for new ones."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from math import asin, degrees, floor
from pathlib import Path
from random import Random
from statistics import fmean

import numpy as np

from texgs.core.cache import combined_checksum, sha256
from texgs.core.camera import Camera, orbit
from texgs.core.cuts import NO_CUTS
from texgs.core.errors import ArgumentError
from texgs.core.figures import write_grid
from texgs.core.io import read_json, write_json
from texgs.core.lens import Lens
from texgs.core.light import HIDING
from texgs.core.progress import progress
from texgs.fields.field import Composed
from texgs.fields.files import kind_of
from texgs.metrics.quality import MAX_PSNR, compare
from texgs.report.beside_volume import pictures
from texgs.report.results import CheckResult
from texgs.scene.cut_view import scene_and_volume
from texgs.scene.scene import Scene
from texgs.scene.twin import Twin

MISSED_SHARE = 0.05  # share of new views that may fall below the floor
LIT_SHARE, EDITED_SHARE = 0.7, 0.5  # shares: views under a random light, edited opacities and palettes
OPACITY_FACTORS = (0.2, 1.5)  # factors
WORST_COUNT = 4  # worst views to show


def check(
    scene: Scene, composition: Composed, twin: Twin, lens: Lens, count: int, seed: int, file: Path
) -> CheckResult:
    """Compare `random_shots` of a scene with its volume, and write the result to a JSON file.

    The worst are drawn into a PNG beside it.
    """
    floor_of([MAX_PSNR] * count)  # refuses too few views before the work
    drawn, psnr, on_object, share = (
        list(random_shots(scene, lens, count, seed)),
        *(list[float]() for _ in range(3)),
    )
    for _, camera, changed in progress(drawn, title="check", unit="view"):
        scores = compare(*scene_and_volume(composition, camera, changed, twin))
        psnr.append(scores["psnr"])
        on_object.append(scores.get("object_psnr", MAX_PSNR))
        share.append(scores.get("shown", 1.0))
    worst = sorted(range(count), key=psnr.__getitem__)[:WORST_COUNT]
    shown = [pictures(*scene_and_volume(composition, *drawn[index][1:], twin)) for index in worst]
    titles = [f"{drawn[index][0]}\n{psnr[index]:.1f} dB" for index in worst]
    write_grid(file.with_suffix(".png"), {name: [each[name] for each in shown] for name in shown[0]}, titles)
    lights = "lights" if scene.light == scene.light.unhidden else "lights with shadows"
    part, whole, there = (floor(10 * floor_of(x)) / 10 for x in (on_object, psnr, [100 * x for x in share]))
    sentence = (
        f"At least {part:.1f} dB on the object from direct volume rendering in 95 of 100 such views, of the "
        f"whole picture {whole:.1f} dB, and {there:.1f} % of what it shows is there (views from anywhere, "
        f"{lights} and edits at random)."
    )
    seen = count, seed, lens.width, lens.height
    result = CheckResult(
        sentence,
        checksum_of(scene),
        *seen,
        statistics_of(psnr),
        statistics_of(on_object),
        statistics_of(share),
    )
    write_json(file, asdict(result))
    return result


def found_sentence(path: Path, scene: Scene) -> str:
    """Return the sentence of an earlier check of a scene's models, here, beside its file or in results."""
    name = f"{path.stem}-check.json"
    for file in (Path(name), path.with_name(name), path.resolve().parent.with_name("pse") / "check.json"):
        if file.is_file():
            found = read_json(file)
            if isinstance(found, dict) and found.get("models") == checksum_of(scene):
                return str(found.get("sentence", ""))
    return ""


def checksum_of(scene: Scene) -> str:
    """Return a checksum of the models with their looks, and of shadows; independent of other edits."""
    files = [(name, sha256(file)) for name, model in scene.models.items() for file in model.files if file]
    if scene.light != scene.light.unhidden:
        files += [(key, str(getattr(scene.light, key))) for key in HIDING]
    return combined_checksum(files)


def random_shots(scene: Scene, lens: Lens, count: int, seed: int) -> Iterator[tuple[str, Camera, Scene]]:
    """Yield independent views with a title, from anywhere on a sphere, with lights and edits at random.

    They are not cut: a cut scene may show its volume itself. Shadows and occlusion, and opacities and
    palettes that are not edited, are those of the scene. A seed gives the same again.
    """
    random = Random(seed)

    def anywhere() -> tuple[float, float]:
        return random.uniform(-180, 180), degrees(asin(random.uniform(-1, 1)))

    for _ in range(count):
        azimuth, polar = anywhere()
        light = replace(scene.light, kind="headlight")
        if random.random() < LIT_SHARE:
            light = light.turned(*anywhere())
        models = {}
        for name, model in scene.models.items():
            edit, can = model.edit, kind_of(model.file).can
            if random.random() < EDITED_SHARE and "opacity" in can:
                edit = replace(edit, opacity=random.uniform(*OPACITY_FACTORS))
            if random.random() < EDITED_SHARE and "palette" in can:
                edit = replace(edit, palette=(random.random(), random.random(), random.random()))
            models[name] = replace(model, edit=edit)
        lit = light.kind if light.kind == "headlight" else f"light {light.azimuth:.0f}°, {light.polar:.0f}°"
        title = f"camera {azimuth:.0f}°, {polar:.0f}°\n{lit}"
        yield title, orbit(azimuth, polar, *lens), replace(scene, models=models, light=light, cuts=NO_CUTS)


def statistics_of(values: Sequence[float]) -> dict[str, float]:
    """Return statistics of the values of all views, by name."""
    low = float(np.percentile(values, 5))
    return {"mean": fmean(values), "percentile_5": low, "worst": min(values), "floor": floor_of(values)}


def floor_of(values: Sequence[float]) -> float:
    """Return the value that a new one reaches with probability 1 - MISSED_SHARE: split conformal prediction.

    It is the k-th smallest of n values, k = floor(MISSED_SHARE (n + 1)): of 64 the third. Proof: the new
    value and the n are exchangeable, so its rank among all n + 1, ties broken at random, is uniform. If it is
    below the k-th smallest of the others, at most k - 1 of them are not above it, and its rank is k at most,
    which has the probability k / (n + 1) <= MISSED_SHARE (Vovk, Gammerman and Shafer 2005).

    Raises:
        ArgumentError: if there are too few for k = 1.
    """
    k = int(MISSED_SHARE * (len(values) + 1))
    if k < 1:
        raise ArgumentError(f"views: expected at least {round(1 / MISSED_SHARE) - 1}, got {len(values)}")
    return sorted(values)[k - 1]
