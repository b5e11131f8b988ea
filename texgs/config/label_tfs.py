"""The basic transfer functions of labels."""

from collections.abc import Sequence
from itertools import chain, count

from texgs.config.project import FORBIDDEN_LETTERS, is_name
from texgs.volume.basic_tfs import BasicTF
from texgs.volume.label_masks import HALF, INSIDE
from texgs.volume.label_names import Label, color_of

OPACITY = 0.95  # of a label


def label_tfs(labels: Sequence[Label]) -> dict[str, BasicTF]:
    """Return a basic TF for each label: its mask from one half on, in its colour.

    They have the names of labels, where TFs can have these, or their numbers.
    """
    found: dict[str, BasicTF] = {}
    for label in labels:
        numbered, color = f"label_{label.number}", label.color or color_of(label.number)
        own, more = FORBIDDEN_LETTERS.sub("_", label.name).strip("_"), (f"{numbered}_{k}" for k in count(2))
        name = next(each for each in chain((own, numbered), more) if is_name(each) and each not in found)
        points = [[HALF, OPACITY], [INSIDE, OPACITY]], [[HALF, *(round(each, 3) for each in color)]]
        found[name] = BasicTF(*points, label=label.name)
    return found
