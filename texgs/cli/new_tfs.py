"""Transfer functions of a new data set: from files, or suggested for its channels or its histogram."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texgs.config.project import FORBIDDEN_LETTERS, check_name
from texgs.core.errors import ArgumentError, ConfigError, TexgsError

if TYPE_CHECKING:
    from texgs.config.dataset import Dataset
    from texgs.config.schema import Config
    from texgs.volume.axes import Channel
    from texgs.volume.basic_tfs import BasicTF
    from texgs.volume.transfer import TransferFunction


def with_tfs(config: Config, channels: dict[str, Channel | None], arguments: argparse.Namespace) -> Dataset:
    """Read the volume, choose TFs of its channels, draw them, and return the data set."""
    from texgs.config.dataset import BasicTF
    from texgs.volume.summaries import read_summaries
    from texgs.workflow.checks import check_basic_tfs, check_channels
    from texgs.workflow.execution import ensure
    from texgs.workflow.result import forget
    from texgs.workflow.stage_table import STAGES

    dataset = config.dataset
    if len(channels) > 1:
        dataset = replace(dataset, basic_tfs={key: BasicTF(channel=key) for key in channels})
        check_channels(dataset)
    output = Path(config.results, dataset.name, "volume")
    try:
        ensure(STAGES["volume"], replace(config, dataset=dataset))
    except TexgsError:
        forget(output)
        raise
    known = read_summaries(output / "volume.nrrd")
    if len(channels) > 1:
        listed = of_each(known, channels, arguments)
    else:
        basic = basic_tfs(dataset.name, known[""], channels[""], arguments.tf, arguments.count)
        listed = {key: BasicTF(**tf.to_dict()) for key, tf in basic.items()}
    dataset = replace(dataset, basic_tfs=listed)
    check_basic_tfs(dataset)
    ensure(STAGES["transfer"], replace(config, dataset=dataset))
    return dataset


def of_each(
    known: Mapping[str, Any], channels: Mapping[str, Channel | None], arguments: argparse.Namespace
) -> dict[str, BasicTF]:
    """Return TFs of all channels, named by their labels: one of each, unless a count says otherwise."""
    from texgs.config.dataset import BasicTF
    from texgs.volume.suggest import COLORS, window_function

    files = arguments.tf
    if files and len(files) != len(channels):
        raise ArgumentError(
            f"--tf: expected a file for each of the channels {', '.join(channels)}, got {len(files)}"
        )
    listed, names = {}, tf_names(list(channels))
    for number, (key, channel) in enumerate(channels.items()):
        has_look = channel and window_function(channel, known[key]["minimum"], known[key]["maximum"])
        count = arguments.count or (None if has_look else 1)
        basic = basic_tfs(key, known[key], channel, files and files[number : number + 1], count)
        for name, tf in basic.items():
            if len(basic) == 1 and count and not files:
                tf = tf.with_points(tf.opacity, [(tf.support[0], *COLORS[number % len(COLORS)])])
            whole = names[number] if len(basic) == 1 else f"{names[number]}_{name}"
            listed[whole] = BasicTF(**tf.to_dict(), channel=key)
    return listed


def tf_names(labels: list[str]) -> list[str]:
    """Return names of TFs like the labels of channels, or with their numbers where these cannot be names."""
    names = [FORBIDDEN_LETTERS.sub("_", label) for label in labels]
    names = [name if name[:1].isalpha() else f"channel_{name}" for name in names]
    try:
        for name in names:
            check_name("dataset.basic_tfs", name)
    except ConfigError:
        names = []
    return names if len(set(names)) == len(labels) else [f"channel_{k}" for k in range(len(labels))]


def basic_tfs(
    of: str, summary: Mapping[str, Any], channel: Channel | None, files: list[Path] | None, count: int | None
) -> dict[str, TransferFunction]:
    """Return TFs from files, or suggested for a channel or from the histogram in a summary."""
    import numpy as np

    from texgs.volume.suggest import looks_like_labels, suggest
    from texgs.volume.tf_files import read_tf

    low, high = summary["minimum"], summary["maximum"]
    if not files:
        histogram = np.array(summary["histogram"])
        if not summary.get("robust") and looks_like_labels(histogram, high - low):
            sys.stderr.write(
                f"{of}: values are in {np.count_nonzero(histogram)} of {len(histogram)} parts of [{low:g}, "
                f"{high:g}], and are taken for labels. Between two of them rays see those in between, as "
                "thin shells. If one stands for missing samples, write NaN in its place and add "
                "nan_value=...\n"
            )
        return suggest(summary, count, channel)
    basic = {f"TF{index + 1:02}": read_tf(path) for index, path in enumerate(files)}
    for path, tf in zip(files, basic.values(), strict=True):
        first, last = tf.support
        if last <= 1 < high:
            raise ArgumentError(
                f"{path}: expected values of the data, which go up to {high:g}, got a TF on [{first:g}, "
                f"{last:g}]; rescale it to the data in ParaView first"
            )
    return basic
