"""Metric `readability`: what is left of the data in a look, by hue and by light, and before the edit."""

from texgs.metrics.metric import Measure, MeasuredScene, Metric


def run(measured: MeasuredScene) -> dict[str, float]:
    """Measure shares of pixels in both scenes; without a volume, depth is compared with the scene before."""
    import torch

    from texgs.metrics.readability import keeps_order, shares_of, told_by_hue, under_light_alone
    from texgs.scene.legend import legend_of

    before, opened = measured.scenes[0], measured.compositions[0]
    fitted = [opened.render(camera, before.light, before.edits) for camera in measured.some]
    edited = [measured.frame(place) for place in measured.places]
    legend: dict[str, list[tuple[float, ...]]] = {}
    for entry in legend_of(before, opened.palettes):
        legend.setdefault(entry.name.partition("/")[0], []).extend(entry.colors)
    has_hues, colors = len({*map(tuple, legend.values())}) > 1, [*map(torch.tensor, legend.values())]
    pixels: dict[str, list[torch.Tensor]] = {}
    for at, (end, views) in enumerate({"_before": fitted, "": edited}.items()):
        shares = shares_of(measured, at, [*legend]) if has_hues else []
        pixels[f"hue_told{end}"] = [*map(told_by_hue, views, shares, [colors] * len(shares))]
        references = under_light_alone(measured, at) if measured.scenes[at].volume else [[], fitted][at]
        pixels[f"depth_order{end}"] = [*map(keeps_order, views, references)]
    return {n: float(torch.cat(each).float().mean()) for n, each in pixels.items() if sum(map(len, each))}


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
