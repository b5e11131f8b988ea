"""Stage `cuts`: seeded planes through a scene, as fitted and edited, and ways to show what they cut."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import asin, atan2, cos, degrees, radians
from pathlib import Path
from statistics import fmean, median
from typing import TYPE_CHECKING, Any

from texgs.core.errors import ConfigError
from texgs.core.progress import progress
from texgs.report.results import CutResult, CutWay
from texgs.workflow.inputs import has_scene, has_volume, scene_and_volume
from texgs.workflow.stage import EVERY, Config, Outcome, Rule, Stage, read
from texgs.workflow.stages.settings import OfScene

if TYPE_CHECKING:
    import torch
    from torch import Tensor

    from texgs.core.camera import Camera
    from texgs.core.cuts import Plane
    from texgs.core.lens import Frame
    from texgs.fields.surfels.composition import Composition
    from texgs.raster import Render
    from texgs.scene.scene import Scene
    from texgs.scene.twin import Twin

FACING = 55.0  # largest angle between a plane's normal and the direction to the camera, degrees
DEEPEST = 0.6  # largest distance of a plane from the centre, in radii of what is visible
BAND = 5  # pixels to both sides of a face's edge
LEAST = 100  # pixels of a face, or of its edge, that is measured
SHOWN = 5  # planes in the picture
PICTURED = ("volume", "slab", "dropped")  # ways
COMPARED = ("dropped", "clipped", "slab")
PLANE, PLANES, EDITED = "a plane", "three planes", "a plane, edited"  # cases
HIDDEN = -100.0  # opacity before the sigmoid


@dataclass(kw_only=True)
class Settings(OfScene):
    """What the stage reads of the configuration."""

    planes: int = read("metric.cut_planes")


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write cuts.png. It reads `scene`, the scene.yaml, with what it names."""
    from texgs.core.check import torch_device
    from texgs.core.cuts import Cuts
    from texgs.core.figures import write_grid
    from texgs.metrics.quality import psnr
    from texgs.scene.scene_file import read_scene
    from texgs.scene.twin import Twin
    from texgs.workflow.stages.pse import chain

    scene = read_scene(inputs["scene"])
    device = torch_device(settings.fit.device)
    composed: Any = scene.open(device)
    twin = Twin(scene, device)
    shots = seeded(scene.framed(composed), settings)
    shown = {
        PLANE: (scene, 1),
        PLANES: (scene, 3),
        EDITED: (list(chain(scene, composed.palettes, ("palette", "relight")).values())[-1], 1),
    }
    rows, ms, scores = (defaultdict[Any, list[Any]](list) for _ in range(3))
    for camera, planes in progress(shots, settings.planes, title=f"{settings.dataset}: cuts", unit="shot"):
        camera = camera.to(device)
        for case, (seen, count) in shown.items():
            cut, images = replace(seen, cuts=Cuts(planes[:count])), {}
            for way, render in ways_of(composed, twin, camera, cut).items():
                milliseconds, color = timed(render, device)
                images[way] = color.clamp(0, 1)
                ms[case, way].append(milliseconds)
            for place, mask in places(composed, twin, camera, cut).items():
                for way in COMPARED if int(mask.sum()) >= LEAST else ():
                    score = psnr(images[way][mask][None], images["volume"][mask][None])
                    scores[case, way, place].append(score)
            for way in PICTURED if case == PLANE else ():
                rows[way].append(images[way].cpu().numpy())
    titles = [f"plane {number + 1}" for number in range(min(SHOWN, settings.planes))]
    write_grid(output / "cuts.png", {way: images[:SHOWN] for way, images in rows.items()}, titles)
    result = CutResult(settings.planes, settings.views.width, settings.views.height)
    return Outcome(replace(result, ways=[summary(case, way, ms[case, way], scores) for case, way in ms]))


def timed(render: Callable[[], Render], device: torch.device) -> tuple[float, Tensor]:
    """Return how long a frame takes until it is there, milliseconds, and its colours."""
    import torch

    if device.type == "cuda":
        torch.cuda.synchronize(device)
    start = time.perf_counter()
    color = render().color
    if device.type == "cuda":
        torch.cuda.synchronize(device)
    return 1000 * (time.perf_counter() - start), color


def seeded(frame: Frame, settings: Settings) -> Iterator[tuple[Camera, list[Plane]]]:
    """Yield cameras with three planes each, at some depth of what is visible; the first faces the camera."""
    import torch
    from torch.nn.functional import normalize

    from texgs.core.camera import orbit
    from texgs.core.cuts import Plane

    lens = frame.lens(settings.views.fov_y, settings.views.width, settings.views.height)
    rng = torch.Generator().manual_seed(settings.fit.seed)
    target, count = torch.tensor(frame.target, dtype=torch.float64), 0
    while count < settings.planes:
        directions = normalize(torch.randn(4, 3, generator=rng, dtype=torch.float64), dim=1)
        depths = DEEPEST * frame.radius * (2 * torch.rand(3, generator=rng, dtype=torch.float64) - 1)
        (x, y, z), normals = directions[0], directions[1:]
        if normals[0] @ directions[0] < cos(radians(FACING)):
            continue
        count += 1
        offsets = (normals @ target + depths).tolist()
        camera = orbit(degrees(atan2(-z, x)), degrees(asin(y)), *lens)
        yield camera, [Plane(*plane) for plane in zip(normals.tolist(), offsets, strict=True)]


def ways_of(composed: Composition, twin: Twin, camera: Camera, cut: Scene) -> dict[str, Callable[[], Render]]:
    """Return ways to show a cut scene by name, and the frame of the scene that is not cut."""
    from texgs.scene.cut_view import cut_view, slab_view
    from texgs.scene.twin import range_of

    def models(shown: Composition) -> Render:
        return shown.render(
            camera, cut.light, cut.edits, background=camera.viewmat.new_tensor(cut.background)
        )

    kept = without_centres(composed, cut)
    return {
        "uncut": lambda: models(composed),
        "dropped": lambda: models(kept),
        "clipped": lambda: cut_view(composed, camera, cut, None),
        "slab": lambda: slab_view(composed, camera, cut, twin, range_of(cut.cuts, camera)),
        "volume": lambda: twin.render(camera, cut, composed.palettes),
    }


def without_centres(composed: Composition, cut: Scene) -> Composition:
    """Return models without the surfels whose centres a cut takes away, as viewers of splats show cuts."""
    import torch

    from texgs.fields.surfels.composition import Composition

    kept = []
    for model in (part.model for part in composed.parts):
        p = model.parameters
        beyond = torch.zeros_like(p["opacities"], dtype=torch.bool)
        for plane in cut.cuts.half_spaces:
            beyond |= p["means"] @ p["means"].new_tensor(plane.normal) > plane.offset
        opacities = p["opacities"].masked_fill(beyond, HIDDEN)
        kept.append(replace(model, parameters={**p, "opacities": opacities}))
    return Composition(kept)


def places(composed: Composition, twin: Twin, camera: Camera, cut: Scene) -> dict[str, Tensor]:
    """Return pixels [H, W] bool: all, those of a face, and a band along the edge of the face."""
    import cv2
    import torch

    from texgs.scene.cut_view import OPAQUE, face_alpha
    from texgs.scene.twin import range_of

    face = face_alpha(composed, camera, cut, twin, range_of(cut.cuts, camera)) >= OPAQUE
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * BAND + 1, 2 * BAND + 1))
    edge = cv2.morphologyEx(face.cpu().numpy().astype("uint8"), cv2.MORPH_GRADIENT, disc)
    band = torch.from_numpy(edge).to(face.device).bool()
    return {"whole": torch.ones_like(face), "face": face, "band": band}


def summary(
    case: str, way: str, ms: Sequence[float], scores: Mapping[tuple[str, str, str], Sequence[float]]
) -> CutWay:
    """Return means and tenths over the planes, and the median time of a frame."""
    numbers: dict[str, float] = {}
    for place in ("whole", "face", "band"):
        if values := scores.get((case, way, place)):
            numbers |= {place: fmean(values), f"{place}_tenth": quantile(values)}
    return CutWay(case, way, median(ms), **numbers)


def quantile(values: Sequence[float]) -> float:
    """Return the value that a tenth of them does not reach."""
    import numpy as np

    return float(np.quantile(values, 0.1))


def applies(config: Config) -> bool:
    """Return whether a scene of surfels is cut beside its volume."""
    is_asked = config.metric.cut_planes > 0 and config.fit.field == "surfels"
    return is_asked and has_scene(config) and has_volume(config)


def inputs_of(config: Config) -> dict[str, Path]:
    """Return the scene and its volume, once there is a plane to cut by."""
    if not config.metric.cut_planes:
        raise ConfigError("metric.cut_planes: expected at least 1 plane, got 0; experiment=cuts has 20")
    return scene_and_volume(config)


STAGE = Stage(
    "cuts",
    order=145,
    help="cut a scene by seeded planes beside the cut volume",
    rule=Rule(
        "cuts",
        "{dataset}/scene/{fit}/cuts",
        ("cuts.png",),
        target="scenes",
        threads=EVERY,  # other jobs would be measured with it
        gpu=("fit",),
        shown={
            "cuts.png": "Cuts: the volume; a slab of the volume over the clipped models; surfels dropped by "
            "their centres, as other viewers of splats do."
        },
    ),
    inputs=inputs_of,
    work=work,
    applies=applies,
)
