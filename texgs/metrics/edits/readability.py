"""Metric `readability`: what is left of the data in a look, by hue and by light, and before the edit."""

from texgs.metrics.metric import Measure, MeasuredScene, Metric


def run(measured: MeasuredScene) -> dict[str, float]:
    """Measure shares of pixels in both scenes; without a volume, depth is compared with the scene before."""
    import torch

    from texgs.metrics.readability import (
        keeps_order,
        legend_colors,
        mean_told,
        shares_of,
        told_by_hue,
        under_light_alone,
    )

    before, opened = measured.scenes[0], measured.compositions[0]
    fitted = [opened.render(camera, before.light, before.edits) for camera in measured.some]
    edited, legend = [measured.frame(place) for place in measured.places], legend_colors(measured)
    values: dict[str, float] = {}
    for at, (end, views) in enumerate({"_before": fitted, "": edited}.items()):
        shares = shares_of(measured, at, [*legend]) if legend else []
        told = [told_by_hue(*each, [*legend.values()]) for each in zip(views, shares, strict=False)]
        if any(len(shown) for shown, _ in told):
            values[f"hue_told{end}"] = mean_told(told)
        references = under_light_alone(measured, at) if before.volume else [[], fitted][at]
        kept = [keeps_order(*each) for each in zip(views, references, strict=False)]
        if any(map(len, kept)):
            values[f"depth_order{end}"] = float(torch.cat(kept).float().mean())
    return values


METRIC = Metric(
    "readability",
    (
        Measure("hue_told", "told by hue", 3, "up"),
        Measure("hue_told_before", "told by hue, before", 3),
        Measure("depth_order", "depth order", 3, "up"),
        Measure("depth_order_before", "depth order, before", 3),
    ),
    run,
    order=90,
    is_in_paper=False,
)
