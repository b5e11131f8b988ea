"""Metric `retrieval`: distances of framed views from each picture of texgs, by colours and by pattern.

From these distances tables compute the rank of the picture that a look follows, see `places_among`.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from texgs.metrics.metric import Measure, MeasuredScene, Metric


def run(measured: MeasuredScene) -> dict[str, Any]:
    """Measure distances of the visible scene; nothing without weights or visible parts."""
    from texgs.metrics.retrieval import scene_likeness, style_likeness
    from texgs.models.pictures import PICTURES

    seen = measured.vgg and scene_likeness(measured.after, measured.shown, measured.vgg)
    if not seen:
        return {}
    far = seen.distances(style_likeness(measured.shown.device))
    return {f"far_by_{kind}": dict(zip(PICTURES, each.tolist(), strict=True)) for kind, each in far.items()}


def places_among(looks: Sequence[tuple[str, Mapping[str, Any]]]) -> list[dict[str, int]]:
    """Return the rank of the picture that each look of a scene follows, 1 for the nearest, by measure.

    A picture that is near to all looks says little about one, so the mean over the looks is taken from the
    distances to it. It takes two looks at least, that were compared with the same pictures. Pictures
    that are as near have the last place of them all: looks that are alike say nothing.

    Args:
        looks: the picture of each, and what was measured of it. One without distances, or of another picture
            than those compared, has no place.
    """
    import numpy as np

    places: list[dict[str, int]] = [{} for _ in looks]
    for kind in ("colors", "pattern"):
        name = f"far_by_{kind}"
        far = {at: values[name] for at, (_, values) in enumerate(looks) if name in values}
        pictures = Counter(map(tuple, far.values())).most_common(1)[0][0] if far else ()
        compared = [at for at in far if tuple(far[at]) == pictures]
        if len(compared) < 2:
            continue
        table = np.array([[*far[at].values()] for at in compared])
        for at, row in zip(compared, table - table.mean(0), strict=True):
            if (followed := looks[at][0]) in pictures:
                places[at][f"place_by_{kind}"] = int((row <= row[pictures.index(followed)]).sum())
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
    among=places_among,
)
