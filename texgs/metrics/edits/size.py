"""Metric `size`: megabytes of all models, counted as in the paper's tables of edits, and primitives."""

from texgs.metrics.metric import Measure, MeasuredScene, Metric


def run(measured: MeasuredScene) -> dict[str, float]:
    """Count bytes of the models without redundant texels, and primitives of the scene."""
    from texgs.core.memory import MIB
    from texgs.fields.surfels.texels import reduce_constant_textures

    models = [entry.open()[0] for entry in measured.after.models.values()]
    megabytes = sum(reduce_constant_textures(model).sizes()["files_mib"] for model in models) * MIB / 1e6
    return {"megabytes": megabytes, "primitives": len(measured.shown)}


METRIC = Metric(
    "size",
    (
        Measure("megabytes", "MB", 1, "down", "model_mb"),
        Measure("primitives", "primitives", 0, "", "primitives"),
    ),
    run,
    order=40,
)
