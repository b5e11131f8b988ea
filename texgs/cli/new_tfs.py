"""Transfer functions of a new data set: from files, or suggested for its channels or its histogram."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texgs.config.project import FORBIDDEN_LETTERS, is_name
from texgs.core.errors import ArgumentError, TexgsError

if TYPE_CHECKING:
    from texgs.config.dataset import Dataset
    from texgs.config.schema import Config
    from texgs.volume.axes import Channel
    from texgs.volume.basic_tfs import BasicTF
    from texgs.volume.transfer import TransferFunction


def read_volume(config: Config, channels: Mapping[str, Channel | None]) -> dict[str, Any]:
    """Prepare all channels of a volume, and the labels of basic TFs; return their summaries."""
    from texgs.config.dataset import BasicTF
    from texgs.volume.summaries import read_summaries
    from texgs.workflow.checks import check_channels
    from texgs.workflow.execution import ensure
    from texgs.workflow.result import forget
    from texgs.workflow.stage_table import STAGES

    dataset = config.dataset
    if len(channels) > 1:
        shown = {f"channel {key}": BasicTF(channel=key) for key in channels}  # as no TF of a label is named
        dataset = replace(dataset, basic_tfs={**shown, **dataset.basic_tfs})
    check_channels(dataset)
    output = Path(config.results, dataset.name, "volume")
    try:
        ensure(STAGES["volume"], replace(config, dataset=dataset))
    except TexgsError:
        forget(output)
        raise
    return read_summaries(output / "volume.nrrd")


def with_tfs(
    config: Config,
    known: dict[str, Any],
    channels: Mapping[str, Channel | None],
    arguments: argparse.Namespace,
) -> Dataset:
    """Choose TFs of channels beside those of labels, draw them, and return the data set."""
    from texgs.config.dataset import BasicTF
    from texgs.workflow.checks import check_basic_tfs
    from texgs.workflow.execution import ensure
    from texgs.workflow.stage_table import STAGES

    dataset, listed = config.dataset, {}
    if len(channels) > 1:
        listed = of_each(known, channels, arguments)
    elif channels:
        basic = basic_tfs(known[""], channels[""], arguments.tf, arguments.count)
        listed = {key: BasicTF(**tf.to_dict()) for key, tf in basic.items()}
    # Labels have names that others do not have.
    labels = {f"label_{name}" if name in listed else name: tf for name, tf in dataset.basic_tfs.items()}
    dataset = replace(dataset, basic_tfs={**listed, **labels})
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
        basic = basic_tfs(known[key], channel, files and files[number : number + 1], count)
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
    are_names = all(map(is_name, names)) and len(set(names)) == len(labels)
    return names if are_names else [f"channel_{k}" for k in range(len(labels))]


def basic_tfs(
    summary: Mapping[str, Any], channel: Channel | None, files: list[Path] | None, count: int | None
) -> dict[str, TransferFunction]:
    """Return TFs from files, or suggested for a channel or from the histogram in a summary."""
    from texgs.volume.suggest import suggest
    from texgs.volume.tf_files import read_tf

    if not files:
        return suggest(summary, count, channel)
    basic = {f"TF{index + 1:02}": read_tf(path) for index, path in enumerate(files)}
    for path, tf in zip(files, basic.values(), strict=True):
        first, last = tf.support
        if last <= 1 < (high := summary["maximum"]):
            raise ArgumentError(
                f"{path}: expected values of the data, which go up to {high:g}, got a TF on [{first:g}, "
                f"{last:g}]; rescale it to the data in ParaView first"
            )
    return basic
