"""Labels of a new data set: whether its file holds some, and which of them are shown."""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import yaml

from texgs.core.errors import ArgumentError

if TYPE_CHECKING:
    from texgs.config.dataset import Dataset
    from texgs.config.schema import Config
    from texgs.volume.label_names import Label

KIND_KEYS = {"kind", "labels"}  # of a volume: they say what samples are


def without_lists(words: list[str]) -> tuple[list[str], list[str] | None]:
    """Return words without labels=[...], and the names and numbers that it lists."""
    lists = [word for word in words if word.startswith("labels=[")]
    if not lists:
        return words, None
    try:
        wanted = yaml.load(lists[-1].removeprefix("labels="), yaml.BaseLoader)
    except yaml.YAMLError:
        wanted = None
    if not isinstance(wanted, list) or not all(isinstance(each, str) for each in wanted):
        raise ArgumentError(f"{lists[-1]}: expected names or numbers of labels, as in labels=[3,5,liver]")
    return [word for word in words if word not in lists], wanted


def as_labels(config: Config) -> Config:
    """Return a configuration whose volume is read as labels, and say so."""
    dataset = config.dataset
    sys.stderr.write(f"{dataset.name}: samples are taken for labels; kind=image reads them as values\n")
    return replace(config, dataset=replace(dataset, volume=replace(dataset.volume, kind="labels")))


def found_in(dataset: Dataset, table: Path | None, channel: str | None) -> list[Label]:
    """Return the labels of a data set's volume, or beside a channel of its image, the largest first."""
    from texgs.volume.label_choice import labels_in
    from texgs.volume.label_names import named_in
    from texgs.volume.settings import open_field, open_labels

    volume = dataset.volume
    if volume.kind == "image" and not volume.labels:
        return []
    file, image = Path(str(volume.labels or volume.file)), None
    if volume.labels:
        image = open_field(replace(volume, channel=channel), Path(str(volume.file)))
    known, beside = named_in(file, table)
    if beside:
        sys.stderr.write(f"{dataset.name}: names and colours of labels are those of {beside}\n")
    return labels_in(partial(open_labels, volume, file, image=image), known, volume.crop)


def with_chosen(dataset: Dataset, found: list[Label], wanted: list[str] | None, channels: int) -> Dataset:
    """Return a data set with basic TFs of wanted labels, or of the largest; say which are left out."""
    from texgs.config.label_tfs import label_tfs
    from texgs.volume.basic_tfs import MAX_CHANNELS
    from texgs.volume.label_choice import choose

    if not found and wanted:
        raise ArgumentError("labels=[...]: expected a file of labels, got an image; name one by labels=FILE")
    if not found:
        return dataset
    chosen = choose(found, wanted, MAX_CHANNELS - channels, dataset.volume.reduce**3)
    left = [each.name for each in found if each not in chosen]
    if left and wanted is None:
        sys.stderr.write(
            f"{dataset.name}: the {len(chosen)} largest of {len(found)} labels are shown, without "
            f"{', '.join(left[:8])}{', ...' if len(left) > 8 else ''}; labels=[...] chooses others\n"
        )
    numbers = {each.name: each.number for each in chosen if each.is_listed}
    volume = replace(dataset.volume, label_numbers=numbers)
    return replace(dataset, volume=volume, basic_tfs=label_tfs(chosen))
