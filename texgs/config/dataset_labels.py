"""A data set with a basic transfer function for each of some labels."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import chain, count

from texgs.config.dataset import Dataset
from texgs.config.project import FORBIDDEN_LETTERS, is_name
from texgs.volume.label_choice import label_tf
from texgs.volume.label_names import Label


def with_labels(dataset: Dataset, labels: Sequence[Label]) -> Dataset:
    """Return a data set with a basic TF for each label, and with the numbers of names that a table lists."""
    numbers = {each.name: each.number for each in labels if each.is_listed}
    basic_tfs = {name: label_tf(each) for name, each in named(labels).items()}
    return replace(dataset, volume=replace(dataset.volume, label_numbers=numbers), basic_tfs=basic_tfs)


def named(labels: Sequence[Label]) -> dict[str, Label]:
    """Return labels by names that TFs can have: like their own, or by their numbers."""
    found: dict[str, Label] = {}
    for label in labels:
        numbered = f"label_{label.number}"
        more = (f"{numbered}_{k}" for k in count(2))
        for name in chain((FORBIDDEN_LETTERS.sub("_", label.name).strip("_"), numbered), more):
            if is_name(name) and name not in found:
                found[name] = label
                break
    return found
