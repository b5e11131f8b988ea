"""Ways to show a cut against the cut volume: PSNR and the time of a frame, for seeded planes.

`python -m benchmarks.cuts OUTPUT.csv DATASET...` composes scenes by `quick` at 400x400 and cuts them as
fitted and edited. Rows have means, and what a tenth misses, of pictures, faces and bands along their edges.
"""

from dataclasses import replace
from functools import partial
from math import asin, atan2, cos, degrees, radians
from time import perf_counter

import cv2
import pandas as pd
import torch

from benchmarks.command import call
from texgs.cli.main import main as texgs
from texgs.config.compose import compose
from texgs.core.camera import Camera, orbit
from texgs.core.cuts import Cuts, Plane
from texgs.fields.surfels.composition import Composition
from texgs.metrics.quality import psnr
from texgs.report.compared import chain
from texgs.scene.cut_view import FACE_ALPHA, cut_view, face_alpha, slab_view
from texgs.scene.scene import Scene
from texgs.scene.scene_file import read_scene
from texgs.scene.twin import Twin, range_of
from texgs.workflow.stage import result_file

SIZE, COUNT, SEED = 400, 20, 0  # pixels of either side, shots, and seed of these
FACING, DEEPEST = 55.0, 0.6  # most degrees from normal to camera; most radii from a plane to the centre
BAND, LEAST = 5, 100  # pixels to both sides of a face's edge, and pixels of a place that is measured
UNCUT, TRUTH = "not cut", "the volume, cut"  # ways that are compared with nothing


def main(output: str, *datasets: str) -> None:
    """Measure, print and write a row for each data set, case and way."""
    table = pd.concat({name: measured(name) for name in datasets}, names=["data set"]).reset_index()
    print(table.round(2).to_string(index=False))
    table.to_csv(output, index=False, lineterminator="\n")


def measured(dataset: str) -> pd.DataFrame:
    """Return the numbers of a data set by cases and ways."""
    words = (f"dataset={dataset}", "fit=quick", f"views.width={SIZE}", f"views.height={SIZE}")
    texgs(["compose", *words])
    scene = read_scene(result_file("compose", compose(words)))
    composed, twin = scene.open(), Twin(scene)
    edited = list(chain(scene, composed.palettes, ("palette", "relight")).values())[-1]
    cases = {"a plane": (scene, 1), "three planes": (scene, 3), "a plane, edited": (edited, 1)}
    found: list[tuple[str, str, str, float]] = []
    for camera, planes in shots(scene, composed):
        for case, (seen, count) in cases.items():
            cut, images = replace(seen, cuts=Cuts(planes[:count])), {}
            for way, render in ways(composed, twin, camera, cut).items():
                start = perf_counter()
                images[way] = render().color.clamp(0, 1)
                found.append((case, way, "ms", 1000 * (perf_counter() - start)))
            for place, mask in places(composed, twin, camera, cut).items():
                for way in images.keys() - {UNCUT, TRUTH} if int(mask.sum()) >= LEAST else ():
                    score = psnr(images[way][mask][None], images[TRUTH][mask][None])
                    found.append((case, way, place, score))
    names = ["cut by", "way", "measure"]
    groups = pd.DataFrame(found, columns=[*names, "value"]).groupby(names)["value"]
    ms = groups.median().unstack()["ms"]
    ratios = ms.div(ms.xs(UNCUT, level="way"), level="cut by")
    table = groups.mean().unstack().assign(**{"ms": ms, "ms / not cut": ratios})
    return table.join(groups.quantile(0.1).unstack().drop(columns="ms"), rsuffix=", tenth")


def shots(scene: Scene, composed: Composition) -> list[tuple[Camera, list[Plane]]]:
    """Return cameras with three planes each, at some depth of what is visible; the first faces the camera."""
    frame, rng, found = scene.framed(composed), torch.Generator().manual_seed(SEED), []
    target, lens = torch.tensor(frame.target).double(), frame.lens(width=SIZE, height=SIZE)
    while len(found) < COUNT:
        sides = torch.randn(4, 3, generator=rng, dtype=torch.float64)
        (x, y, z), *normals = sides / sides.norm(dim=1, keepdim=True)
        depths = DEEPEST * frame.radius * (2 * torch.rand(3, generator=rng, dtype=torch.float64) - 1)
        if normals[0] @ torch.stack([x, y, z]) >= cos(radians(FACING)):
            planes = [Plane(n.tolist(), float(n @ target + d)) for n, d in zip(normals, depths, strict=True)]
            found.append((orbit(degrees(atan2(-z, x)), degrees(asin(y)), *lens), planes))
    return found


def ways(composed: Composition, twin: Twin, camera: Camera, cut: Scene) -> dict[str, partial]:
    """Return ways to show a cut scene by name, and the frame of the scene that is not cut."""
    whole = {"light": cut.light, "edits": cut.edits, "background": camera.viewmat.new_tensor(cut.background)}
    kept, opened = without_centres(composed, cut), range_of(cut.cuts, camera)
    return {
        UNCUT: partial(composed.render, camera, **whole),
        "surfels dropped by their centres": partial(kept.render, camera, **whole),
        "surfels clipped, no face": partial(cut_view, composed, camera, cut, None),
        "slab of the volume over clipped surfels": partial(slab_view, composed, camera, cut, twin, opened),
        TRUTH: partial(twin.render, camera, cut, composed.palettes),
    }


def without_centres(composed: Composition, cut: Scene) -> Composition:
    """Return models without the surfels whose centres a cut takes away, as viewers of splats show cuts."""
    kept = []
    for model in (part.model for part in composed.parts):
        p, planes = model.parameters, cut.cuts.half_spaces
        beyond = [p["means"] @ p["means"].new_tensor(each.normal) > each.offset for each in planes]
        opacities = p["opacities"].masked_fill(torch.stack(beyond).any(0), -100.0)  # before the sigmoid
        kept.append(replace(model, parameters={**p, "opacities": opacities}))
    return Composition(kept)


def places(composed: Composition, twin: Twin, camera: Camera, cut: Scene) -> dict[str, torch.Tensor]:
    """Return pixels [H, W] bool: all, those of a face, and a band along the edge of the face."""
    face = face_alpha(composed, camera, cut, twin, range_of(cut.cuts, camera)) >= FACE_ALPHA
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * BAND + 1, 2 * BAND + 1))
    edge = cv2.morphologyEx(face.numpy().astype("uint8"), cv2.MORPH_GRADIENT, disc)
    return {"whole": torch.ones_like(face), "face": face, "band": torch.from_numpy(edge).bool()}


if __name__ == "__main__":
    call(main, "benchmarks.cuts views surfels shading texture compose pse")
