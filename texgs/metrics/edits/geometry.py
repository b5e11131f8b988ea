"""Metric `geometry`: whether an edit left the geometry unchanged."""

from __future__ import annotations

from typing import TYPE_CHECKING

from texgs.metrics.metric import Measure, MeasuredScene, Metric

if TYPE_CHECKING:
    from torch import Tensor

    from texgs.scene.scene import Scene


def run(measured: MeasuredScene) -> dict[str, bool]:
    """Compare the stored geometry of all models; opacity factors and hidden parts do not count."""
    from torch import equal

    before, after = map(geometry, measured.scenes)
    is_same = before.keys() == after.keys() and all(equal(before[key], after[key]) for key in before)
    return {"geometry_kept": is_same}


def geometry(scene: Scene) -> dict[tuple[str, str], Tensor]:
    """Return the geometry tensors of all models, by model and tensor name."""
    opened = {name: model.open()[0] for name, model in scene.models.items()}
    return {(name, key): x for name, field in opened.items() for key, x in field.tensors("geometry").items()}


METRIC = Metric(
    "geometry",
    (Measure("geometry_kept", "geometry kept", words={True: "bit for bit", False: "no"}),),
    run,
    order=60,
)
