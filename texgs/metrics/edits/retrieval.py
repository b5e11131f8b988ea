"""Metric `retrieval`: how far framed views are from each picture of texgs, with colours and by the pattern.

From these distances tables tell the place of the picture that a look follows, see `named`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from texgs.metrics.metric import Measure, MeasuredScene, Metric

VIEWS = 8  # framed, along a path of their own


def run(measured: MeasuredScene) -> dict[str, Any]:
    """Measure distances of the scene as it is shown; nothing without weights, or where it shows nothing."""
    import torch

    from texgs.metrics.retrieval import LAYERS, SIZE, Likeness, known, likeness
    from texgs.models.pictures import PICTURES
    from texgs.models.vgg import Vgg
    from texgs.volume.cameras import spiral

    if measured.weights["vgg16"] is None:
        return {}
    scene, shown = measured.after, measured.shown
    vgg = Vgg.load(None, shown.device, LAYERS, torch.float32)
    described = []
    for camera in spiral(VIEWS, *scene.framed(shown).lens().square(SIZE)):
        view = shown.render(camera.to(shown.device), scene.light, scene.edits)
        where = view.alpha > min(0.5, 0.5 * float(view.alpha.max()))
        if bool(where.any()):
            described.append(likeness(view.color.clamp(0, 1).permute(2, 0, 1), where, vgg))
    if not described:
        return {}
    far = Likeness.stacked(described).mean.distances(known(shown.device))
    return {f"far_by_{kind}": dict(zip(PICTURES, each.tolist(), strict=True)) for kind, each in far.items()}


def named(looks: Sequence[tuple[str, Mapping[str, Any]]]) -> list[dict[str, int]]:
    """Return the place of the picture that each look of a scene follows, 1 for the nearest, by measures.

    A picture that is near to all looks says little about one, so the mean over the looks is taken from the
    distances to it. It takes two looks at least.

    Args:
        looks: the picture of each, and what was measured of it. One without distances, or of another picture
            than those of texgs, has no place.
    """
    import numpy as np

    places: list[dict[str, int]] = [{} for _ in looks]
    for kind in ("colors", "pattern"):
        name = f"far_by_{kind}"
        compared = [at for at, (_, values) in enumerate(looks) if name in values]
        if len(compared) < 2:
            continue
        pictures = list(looks[compared[0]][1][name])
        far = np.array([[looks[at][1][name][picture] for picture in pictures] for at in compared])
        for at, row in zip(compared, far - far.mean(0), strict=True):
            if (followed := looks[at][0]) in pictures:
                places[at][f"place_by_{kind}"] = int((row < row[pictures.index(followed)]).sum()) + 1
    return places


METRIC = Metric(
    "retrieval",
    (
        Measure("place_by_colors", "place, colours", 0, "down"),
        Measure("place_by_pattern", "place, pattern", 0, "down"),
    ),
    run,
    order=80,
    is_in_paper=False,
    tables=("far_by_colors", "far_by_pattern"),
    among=named,
)
