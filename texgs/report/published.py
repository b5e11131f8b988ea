"""The paper's numbers beside ours: which may stand in one row, and rows of its own for all others."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, TypeVar

from texgs.report.metrics_files import Record, paper
from texgs.report.results import FitResult, Result
from texgs.report.table import UNLIKE, Cell, Row

R = TypeVar("R", bound=Result)
THEIRS = "the paper"  # in place of a recipe, in rows of its own numbers
RECIPE = "paper"  # of conf/fit: what the paper's numbers are of
VIEWS = 162  # training views, where the paper does not say another number
ALIKE = (
    "Numbers of the paper stand beside ours where recipe, size of images and number of training views are "
    f"the paper's; elsewhere there is {UNLIKE}, not like for like. Its transfer functions are not published: "
    "even there scenes differ, so that PSNR, SSIM and primitives are not like for like."
)
Key = tuple[str, ...]  # of a line: its first columns, the data set first
Line = Mapping[str, str]  # of a file of the paper's numbers


@dataclass(frozen=True)
class Ours:
    """A row of ours."""

    row: Row
    record: Record[Any]  # one of its jobs
    key: Key  # of the paper's line about the same
    alike: bool  # whether that stands in the row


@cache
def images() -> dict[str, int]:
    """Width and height of the paper's images, pixels, by data set in the paper's order."""
    return {dataset: int(line["image_px"]) for (dataset,), line in paper("datasets").items()}


def meant(record: Record[Any]) -> str:
    """The data set of a job, or the one that it stands in for."""
    return record.stand_in.replace(" ", "_") or record.dataset


def in_order(records: Iterable[Record[R]]) -> list[Record[R]]:
    """Records sorted by data set, basic TF and label."""
    return sorted(records, key=lambda record: (place_of(record), record.tf or "", record.label))


def place_of(record: Record[Any]) -> tuple[int, int, str]:
    """Where a data set stands in tables: in the paper's order, stand-ins below the real ones, others last."""
    place, _, _ = place_in_paper(meant(record))
    return place, 2 if record.stand_in else 0, record.dataset


def place_in_paper(dataset: str) -> tuple[int, int, str]:
    """The same for a row of the paper: below ours."""
    order = list(images())
    return order.index(dataset) if dataset in order else len(order), 1, dataset


def side_by_side(
    ours: Sequence[Ours], published: Mapping[Key, Line], theirs: Callable[[Key, Line], Row]
) -> list[Row]:
    """Our rows in the paper's order, with rows of its own for the numbers that stand in none of ours.

    Without a data set of the paper's, or a stand-in for one, there are only ours.

    Args:
        ours: rows.
        published: lines of the paper.
        theirs: makes the row of a line.
    """
    placed = [(place_of(each.record), each.row) for each in ours]
    if any(meant(each.record) in images() for each in ours):
        shown = {each.key for each in ours if each.alike}
        rest = {key: line for key, line in published.items() if key not in shown}
        placed += [(place_in_paper(key[0]), theirs(key, line)) for key, line in rest.items()]
    return [row for _, row in sorted(placed, key=lambda each: each[0])]


def is_alike(record: Record[FitResult], pixels: int | None = None, views: int = VIEWS) -> bool:
    """Whether the paper's numbers of a fit may stand beside those of a phase.

    Args:
        record: of the phase.
        pixels: width and height of the paper's images; default those of the data set.
        views: the paper's training views.
    """
    pixels = images().get(record.dataset) if pixels is None else pixels
    seen = (record.result.width, record.result.height, record.result.train_views)
    is_other = bool(record.stand_in) or (bool(record.variant) and not record.is_swept)
    is_paper = record.recipe == RECIPE and not record.facts.get("recipe_changed")
    return is_paper and not is_other and seen == (pixels, pixels, views)


def beside(line: Line | None, keys: Sequence[str], alike: bool) -> list[Cell]:
    """The paper's numbers for the row of ours that they belong to, or the sign that they are of another.

    Args:
        line: of the paper; None where it has none.
        keys: columns of its file.
        alike: whether they may stand there.
    """
    return [cell if cell is None or alike else UNLIKE for cell in numbers(line or {}, *keys)]


def numbers(line: Line, *keys: str) -> list[Cell]:
    """Numbers of the paper, where it has them."""
    return [float(line[key]) if line.get(key) else None for key in keys]
