"""Metric `readability`: what is left of the data in a look, by hue and by light, and before the edit."""

from texgs.metrics.metric import Measure, MeasuredScene, Metric


def run(measured: MeasuredScene) -> dict[str, float]:
    """Measure shares of pixels in both scenes; without a volume, depth is compared with the scene before."""
    import torch

    from texgs.metrics import readability

    before, opened = measured.scenes[0], measured.compositions[0]
    fitted = [opened.render(camera, before.light, before.edits) for camera in measured.some]
    legend = readability.legend_colors(measured)
    edited, colors = [measured.frame(place) for place in measured.places], [*legend.values()]
    values: dict[str, float] = {}
    for at, (end, views) in enumerate({"_before": fitted, "": edited}.items()):
        shares = readability.shares_of(measured, at, [*legend]) if legend else []
        told = [readability.told_by_hue(*each, colors) for each in zip(views, shares, strict=False)]
        if any(map(torch.numel, told)):
            values[f"hue_told{end}"] = readability.mean_told(told)
        if before.volume:
            references = readability.under_light_alone(measured, at)
        else:
            references = fitted if end == "" else []  # the scene before has nothing to be compared with
        kept = [readability.keeps_order(*each) for each in zip(views, references, strict=False)]
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
