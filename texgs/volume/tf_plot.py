"""A plot of transfer functions over the histogram of their volume, and of sizes of labels, with casts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from texgs.core.camera import orbit
from texgs.core.figures import new_figure, words
from texgs.core.light import Light
from texgs.core.names import mask_name
from texgs.volume.caster import Caster
from texgs.volume.framing import frame_of
from texgs.volume.grid import Grid
from texgs.volume.label_masks import HALF
from texgs.volume.overlay import overlays
from texgs.volume.render import Appearance
from texgs.volume.transfer import TransferFunction

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PLOT_INCHES, DPI = (10.0, 4.5), 100  # inches, dots per inch: plots by themselves have 1000 x 450 pixels
SAMPLES = 512
CAST_PIXELS, CAST_INCHES = 160, 1.9  # pixels of a side of a cast, height of the row of them
CASTS = 6  # casts of labels in a row
LEAST_BARS = 4  # that a panel has room for, so that the bar of a single label is no block


def plot(
    channels: Mapping[str, Mapping[str, Any]],
    basic: Mapping[str, TransferFunction],
    title: str = "",
    size: tuple[float, float] = PLOT_INCHES,
    dpi: float = DPI,
    casts: Mapping[str, np.ndarray] | None = None,
) -> Figure:
    """Return a figure of basic transfer functions over the histograms of a volume's channels, see `Summary`.

    Opacity is the height of each coloured area; the grey area is the number of voxels, on a log axis, of
    integers as if each bin held equally many. Channels are one below the other, with their labels; then the
    sizes of labels, and casts of functions as the last rows.
    """
    masks = [label for label in channels if label.startswith(mask_name(""))]
    taken, shown = len(channels) - len(masks), list((casts or {}).items())
    line = len(shown) if not masks else CASTS
    lines = [dict(shown[start : start + line]) for start in range(0, len(shown), line or 1)]
    heights = [*[size[1]] * (taken + bool(masks)), *[CAST_INCHES] * len(lines)]
    figure = new_figure(size[0], sum(heights), dpi)
    rows = figure.subplots(len(heights), squeeze=False, height_ratios=heights)[:, 0]
    for number, (label, summary) in enumerate([*channels.items()][:taken]):
        own = {name: tf for name, tf in basic.items() if tf.channel == number}
        above = ", ".join(filter(None, (title, label)))
        _fill(rows[number], {**summary, **(summary.get("robust") or {})}, own, above)
    if masks:
        _fill_sizes(rows[taken], [*channels.values()], basic, taken)
        rows[taken].set_title("" if taken else words(title))
    for axes, casts in zip(rows[len(rows) - len(lines) :], lines, strict=True):
        axes.imshow(np.concatenate([*casts.values()], axis=1))
        axes.set(xticks=CAST_PIXELS * (np.arange(len(casts)) + 0.5), xticklabels=map(words, casts), yticks=[])
        axes.set_frame_on(False)
    return figure


def casts_of(grid: Grid, basic: Mapping[str, TransferFunction]) -> dict[str, np.ndarray]:
    """Return small pictures [S, S, 3] over white of the volume under each function, and under all."""
    caster, light = Caster(grid, Appearance()), Light("headlight")
    camera = orbit(30.0, 20.0, *frame_of(grid, basic.values()).lens(width=CAST_PIXELS, height=CAST_PIXELS))
    shown = {name: [tf] for name, tf in basic.items()} | {"all": overlays(basic)}
    casts = {name: caster.cast(tfs, camera, light, by_cell=False).rgba.numpy() for name, tfs in shown.items()}
    return {name: (rgba[..., :3] + 1 - rgba[..., 3:]).clip(0, 1) for name, rgba in casts.items()}


def _fill_sizes(
    axes: Axes, channels: list[Mapping[str, Any]], basic: Mapping[str, TransferFunction], first: int
) -> None:
    """Draw a bar for the size of each label, whose channels are those from `first` on."""
    labels = {name: tf for name, tf in basic.items() if tf.channel >= first}
    unit = channels[first]["space"]["unit"]
    for name, tf in reversed(labels.items()):
        summary = channels[tf.channel]
        counts = np.asarray(summary["histogram"])
        edges = np.linspace(summary["minimum"], summary["maximum"], len(counts) + 1)
        inside = counts[edges[1:] > HALF].sum()
        size = inside * (np.prod(summary["spacing"]) if unit else 1)
        bar = axes.barh(words(name), size, color=tf.color[0][1:])
        axes.bar_label(bar, [f"{size:,.0f}" if size >= 1000 else f"{size:.3g}"], padding=4)
    axes.margins(x=0.12)
    axes.set_ylim(-0.6, max(len(labels), LEAST_BARS) - 0.4)
    axes.set_xlabel(f"{unit}³" if unit else "samples")


def _fill(
    opacity: Axes, summary: Mapping[str, Any], basic: Mapping[str, TransferFunction], title: str
) -> None:
    """Draw the functions of a channel over its histogram."""
    counts, edges = _bins(summary)
    voxels = opacity.twinx()
    opacity.set_zorder(voxels.get_zorder() + 1)
    opacity.patch.set_visible(False)  # or it would hide the histogram
    voxels.stairs(counts, edges, fill=True, color="0.82")
    voxels.set(yscale="log", ylim=(0.5, max(2 * counts.max(), 1.0)), ylabel="voxels")
    for name, tf in basic.items():
        _draw(opacity, name, tf)
    lows, highs = zip(edges[[0, -1]], *(tf.support for tf in basic.values()), strict=True)
    low, high = min(lows), max(highs)
    scale = summary.get("scale", "linear")
    margin = 0.02 * (high - low) if scale == "linear" else 0.0  # so that nothing lies on the frame
    opacity.set(xscale=scale, xlim=(low - margin, high + margin), xlabel="value", title=words(title))
    opacity.set(ylim=(0, 1.12), yticks=np.linspace(0, 1, 6), ylabel="opacity")


def _bins(summary: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Return the counts [N] of a histogram and the edges [N + 1] of its bins.

    Of integers, bins that can hold none are left out, and counts are those of the mean number of integers.
    """
    counts = np.asarray(summary["histogram"], dtype=np.float64)
    spaced = np.geomspace if summary.get("scale") == "log" else np.linspace
    edges = spaced(summary["minimum"], summary["maximum"], len(counts) + 1)
    if np.dtype(summary["dtype"]).kind not in "iu":
        return counts, edges
    firsts = np.ceil(edges)  # integers of the bins
    firsts[-1] += 1  # the last bin includes its end
    held = np.diff(firsts)
    some = held > 0
    return counts[some] * held[some].mean() / held[some], np.append(firsts[:-1][some], firsts[-1]) - 0.5


def _draw(axes: Axes, name: str, tf: TransferFunction) -> None:
    """Draw the area below a function's opacity, filled with its colours, and its name at the top."""
    low, high = tf.support
    inner = tf.without_steps()
    points = [value for value, _ in inner.opacity if low < value < high]
    values = np.sort([*np.linspace(low, high, SAMPLES), *points])
    alpha = inner(values)[:, 3]
    (outline,) = axes.fill(
        [low, *values, high], [0, *alpha, 0], facecolor="none", edgecolor="0.15", linewidth=1.2, zorder=3
    )
    colors = tf(np.linspace(low, high, SAMPLES)[None])[..., :3]  # [1, SAMPLES, 3]
    axes.imshow(colors, extent=(low, high, 0, 1), aspect="auto", alpha=0.85, zorder=2).set_clip_path(outline)
    center = values[alpha >= alpha.max() - 1e-9].mean()
    axes.text(center, alpha.max() + 0.015, words(name), ha="center", va="bottom", zorder=4)
