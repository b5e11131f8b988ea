"""The paper's numbers beside ours: in one row if they are comparable, otherwise in separate rows."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from importlib.resources import files
from statistics import fmean
from typing import TYPE_CHECKING, Any, TypeVar

from texgs.report.metrics_files import Record
from texgs.report.results import FitResult
from texgs.report.table import PAPER, SOURCES, UNLIKE_CELL, UNPUBLISHED_CELL, Column, Table, data_frame

if TYPE_CHECKING:
    from pandas import DataFrame

R = TypeVar("R", bound=Record[Any])
PAPER_LABEL = "the paper"  # recipe in rows of the paper
RECIPE = "paper"  # file of conf/fit with results comparable to the paper's
VIEWS = 162  # default number of training views in the paper
DATA, LABEL = "data set", "recipe"  # titles of columns
# Size and number of views, and changes of the recipe, in rows: means are over fits of the same.
VIEWS_COLUMN = "seen"
SCENES = Column("basic scenes", 0)
Rows = Sequence[Mapping[str, Any]]


def paper_file(name: str) -> DataFrame:
    """Read one of the paper's tables as text, by the headings of its file."""
    import pandas as pd  # slow to import

    with files("texgs.report").joinpath("paper", f"{name}.csv").open() as file:
        return pd.read_csv(file, comment="#", dtype=str)


def paper(name: str, keys: Mapping[str, str], numbers: Mapping[str, str]) -> DataFrame:
    """Read the paper's names and numbers of a table, each with titles by their headings in its file."""
    frame = paper_file(name).reindex(columns=[*keys, *numbers]).rename(columns={**keys, **numbers})
    return frame.astype(dict.fromkeys(numbers.values(), float))


@cache
def volumes() -> dict[str, dict[str, Any]]:
    """Return the paper's table of data sets by name, in its order; None for missing numbers."""
    names = ("volume_x", "volume_y", "volume_z", "image_px", "basic_scenes", "volume_mib", "dvr_ms")
    frame = paper("datasets", {"dataset": DATA}, {name: name for name in names}).set_index(DATA)
    return frame.astype(object).where(frame.notna(), None).to_dict("index")


def images(dataset: str) -> int | None:
    """Return width and height of the paper's images of a data set in pixels, or None."""
    return int(volumes()[dataset]["image_px"]) if dataset in volumes() else None


def intended_dataset(record: Record[Any]) -> str:
    """Return the data set of a job, or the one it replaces."""
    return record.stand_in.replace(" ", "_") or record.dataset


def are_of_paper(records: Iterable[Record[Any]]) -> bool:
    """Return whether some jobs are of the paper's data sets, or of stand-ins for them."""
    return any(intended_dataset(record) in volumes() for record in records)


def in_order(records: Iterable[R]) -> list[R]:
    """Return records sorted by data set, basic TF and label."""
    return sorted(records, key=lambda record: (rank(record), record.tf or "", record.label))


def rank(record: Record[Any]) -> tuple[int, int, str]:
    """Return the sort key of a data set: the paper's order, stand-ins below the real ones, others last."""
    place, _, _ = rank_in_paper(intended_dataset(record))
    return place, 2 if record.stand_in else 0, record.dataset


def rank_in_paper(dataset: str) -> tuple[int, int, str]:
    """Return the sort key of a row of the paper, below ours."""
    order = list(volumes())
    return order.index(dataset) if dataset in order else len(order), 1, dataset


def cells(record: Record[Any], **more: Any) -> dict[str, Any]:
    """Return the common cells of a job's rows: names, sort key and file."""
    views = (getattr(record.result, key, 0) for key in ("width", "height", "train_views"))
    return {
        DATA: record.title,
        "TF": record.tf,
        LABEL: record.label,
        "rank": rank(record),
        "published": "" if record.stand_in else record.dataset,  # data set for the paper's numbers
        VIEWS_COLUMN: (*views, bool(record.facts.get("recipe_changed"))),
        SOURCES: [record.path],
        **more,
    }


def is_alike(record: Record[FitResult], pixels: int | None = None, views: int = VIEWS) -> bool:
    """Return whether the paper's numbers, of these pixels and training views, may stand beside a phase's."""
    pixels = images(record.dataset) if pixels is None else pixels
    seen = (record.result.width, record.result.height, record.result.train_views)
    is_other = bool(record.stand_in) or (bool(record.variant) and not record.is_swept)
    is_paper = record.recipe == RECIPE and not record.facts.get("recipe_changed")
    return is_paper and not is_other and seen == (pixels, pixels, views)


def mean(values: Iterable[Any]) -> float | None:
    """Return the mean, or None without values or if one is missing."""
    listed = list(values)
    return fmean(listed) if listed and None not in listed else None


def beside_paper(
    rows: Rows, name: str, keys: Mapping[str, str], columns: Mapping[str, Column], is_sum: bool = False
) -> Table:
    """Return a table of fits: means over the basic scenes of a data set, beside the paper's numbers.

    Rows are of single basic scenes, made of `cells`, with `alike`. The titles in `keys`, which tell rows of
    one data set and recipe apart, and the columns are by their headings in the paper's file. Rows that are
    sums instead stand beside the paper's where they are of as many basic scenes.
    """
    titles = [column.title for column in columns.values()]
    theirs = paper(name, {"dataset": DATA, **keys}, dict(zip(columns, titles, strict=True)))
    theirs[SCENES.title] = [volumes()[dataset]["basic_scenes"] for dataset in theirs[DATA]]
    ours = grouped(rows, (DATA, LABEL, VIEWS_COLUMN, *keys.values()), titles, is_sum)
    if is_sum:
        counts = ours["published"].map(lambda name: volumes().get(name, {}).get("basic_scenes"))
        ours["alike"] &= ours[SCENES.title] == counts
    names = [*map(Column, (DATA, LABEL, *keys.values())), SCENES]
    published = [Column(each.title + PAPER, each.digits, UNPUBLISHED_CELL) for each in columns.values()]
    shown = side_by_side(ours, theirs, ("published", *keys.values()), titles)
    return Table("", [*names, *columns.values(), *published], shown)


def grouped(rows: Rows, keys: Sequence[str], titles: Sequence[str], is_sum: bool) -> DataFrame:
    """Return a row for each group of rows with the same keys, with means or sums of the titles' numbers."""
    names = list(dict.fromkeys((*keys, "TF", "rank", "published", "alike", SOURCES, *titles)))
    merged = [
        {
            **group.iloc[0],
            **{title: sum(group[title]) if is_sum else mean(group[title]) for title in titles},
            SCENES.title: group["TF"].nunique(dropna=False),
            "alike": all(group["alike"]),
            SOURCES: group[SOURCES].sum(),
        }
        for _, group in data_frame(rows, names).groupby(list(keys), sort=False, dropna=False)
    ]
    return data_frame(merged, [*names, SCENES.title])


def side_by_side(ours: DataFrame, theirs: DataFrame, keys: Sequence[str], titles: Sequence[str]) -> DataFrame:
    """Return our rows in the paper's order, with extra rows for the paper's remaining numbers.

    Without a data set of the paper's, or a stand-in for one, there are only ours.
    """
    import pandas as pd  # slow to import

    published = [DATA, *keys[1:]]
    numbers = theirs[[*published, *titles]].astype(object)
    rows = ours.merge(numbers, "left", left_on=list(keys), right_on=published, suffixes=("", PAPER))
    is_alike = rows["alike"].astype(bool)
    for title in titles:
        cell = rows[title + PAPER]
        rows[title + PAPER] = cell.mask(~is_alike & cell.notna(), UNLIKE_CELL)
    if any(place < len(volumes()) for place, _, _ in rows["rank"]):
        shown = set(rows.loc[is_alike, list(keys)].itertuples(index=False, name=None))
        is_left = [key not in shown for key in theirs[published].itertuples(index=False, name=None)]
        left = theirs[is_left]
        left = left.assign(**{LABEL: PAPER_LABEL}, rank=[rank_in_paper(name) for name in left[DATA]])
        rows = pd.concat([rows, left.astype(object)], ignore_index=True)
    places = rows["rank"].tolist()
    return rows.iloc[sorted(range(len(rows)), key=places.__getitem__)]


def mean_rows(rows: Rows, keys: Sequence[str], titles: Iterable[str]) -> list[dict[str, Any]]:
    """Return a row for each group of two rows or more with the same keys, of data sets that count.

    A column of numbers has their mean where all rows have one; words stay where they are the same in all.
    """
    counted = data_frame([row for row in rows if row["counts"]], [*keys, *titles, SOURCES])
    return [
        {
            DATA: f"mean of {len(group)}",
            **group.iloc[0][list(keys)],
            **{title: _mean_cell(group[title].tolist()) for title in titles},
            SOURCES: group[SOURCES].sum(),
        }
        for _, group in counted.groupby(list(keys), sort=False, dropna=False)
        if len(group) > 1
    ]


def _mean_cell(values: Sequence[Any]) -> Any:
    """Return the mean of numbers, or words if they are equal in all rows."""
    if all(isinstance(value, int | float) for value in values):
        return fmean(values)
    return values[0] if len(set(values)) == 1 else None
