"""Table `differences`: values of recipes and edits that differ from the paper."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from texgs.config.compose import preset
from texgs.config.describe import value_at
from texgs.config.project import members
from texgs.core.keys import typed
from texgs.core.plain_yaml import parse_yaml
from texgs.edit.method import NO_METHOD, method_of
from texgs.report.metrics_files import Record, of
from texgs.report.published import are_of_paper
from texgs.report.results import EditResult, FitResult, SheetResult
from texgs.report.table import Column, Table, report_file

COLUMNS = tuple(map(Column, ("what", "the paper", "here", "in", "where the paper says it")))
NO_KEY = "all"  # in rows that no key expresses
CAPTION = (
    "Keys whose values in conf/ are not those of the paper, for the recipes and edits of this report, and "
    "what no key expresses. What a run overrides is not told here."
)


@dataclass(frozen=True)
class Claim:
    """A value in the paper, with its key here."""

    key: str  # such as fit.texture.rate; edit.METHOD.recipe.NAME is a number of an edit's recipe
    paper: Any  # its value
    where: str  # the paper's section
    of: str | None = None  # key whose 0 makes this one meaningless


@dataclass(frozen=True)
class Other:
    """A difference that no key expresses, in words."""

    what: str
    paper: str
    here: str
    where: str


@dataclass(frozen=True)
class Count:
    """Numbers of views in the paper."""

    what: str
    paper: int
    where: str


@dataclass(frozen=True)
class Published:
    """The paper's method: values to compare with configurations, and other facts."""

    views: list[Count]
    keys: list[Claim]
    others: list[Other]


@cache
def published() -> Published:
    """Read the paper's method from recipe.yaml."""
    return typed(Published, parse_yaml(report_file("paper/recipe.yaml")))


def differences(
    recipes: Sequence[str],
    edits: Sequence[str] = (),
    views: Mapping[str, Mapping[int, Sequence[str]]] | None = None,
) -> Table:
    """Return the table of differences from the paper; a difference shared by several files is one row.

    Names without a file in conf/, such as variants of a sweep, are left out, and so is what has nothing to
    compare: fits of other fields than surfels, and edits by methods that are not the paper's.

    Args:
        recipes: of fits, files of conf/fit.
        edits: files of conf/edit.
        views: numbers of "training views" and "test views", each with the data sets that have so many.
    """
    names: dict[tuple[str, str], list[str]] = defaultdict(list)  # by key and value here
    for group, given in (("fit", recipes), ("edit", edits)):
        for name in [name for name in given if name in members(group)]:
            for claim, here in claims_and_values(group, name):
                if plain_value(here) != plain_value(claim.paper):
                    names[claim.key, text(here)].append(name)
    rows = [
        (count.what, text(count.paper), text(here), ", ".join(some), count.where)
        for count in published().views
        for here, some in sorted((views or {}).get(count.what, {}).items())
        if here != count.paper
    ]
    rows += [
        (claim.key, text(claim.paper), here, ", ".join(some), claim.where)
        for claim in published().keys
        for (key, here), some in names.items()
        if key == claim.key
    ]
    rows += [(each.what, each.paper, each.here, NO_KEY, each.where) for each in published().others]
    titles = [column.title for column in COLUMNS]
    return Table(CAPTION, COLUMNS, [dict(zip(titles, row, strict=True)) for row in rows])


def differences_of(records: Sequence[Record[Any]]) -> Table:
    """Return the differences of some jobs' recipes and edits from the paper; no rows for other data."""
    recipes = sorted({record.recipe for record in of(FitResult, records)})
    edits = sorted({record.result.edit for record in of(EditResult, records)})
    table = differences(recipes, edits, views_of(records))
    return table if recipes and are_of_paper(records) else replace(table, rows=[])


def views_of(records: Sequence[Record[Any]]) -> dict[str, dict[int, list[str]]]:
    """Return numbers of training and test views, each with its data sets."""
    views: dict[str, dict[int, set[str]]] = defaultdict(lambda: defaultdict(set))
    for record in of(SheetResult, records):
        for what, count in (("training views", record.result.train), ("test views", record.result.test)):
            views[what][count].add(record.dataset)
    return {what: {n: sorted(names) for n, names in counts.items()} for what, counts in views.items()}


def claims_and_values(group: str, name: str) -> Iterator[tuple[Claim, Any]]:
    """Yield the paper's claims that apply to a file of conf/, each with the file's value."""
    config, prefix, numbers = preset(group, name), "fit.", dict[str, Any]()
    if group == "edit" and config.edit.method != NO_METHOD:
        method = method_of(config.edit)
        prefix, numbers = f"edit.{method.name}.", dict(method.of(config.edit).numbers())
    elif group == "edit" or config.fit.field != "surfels":
        return

    def value(key: str) -> Any:
        _, is_number, number = key.partition(".recipe.")
        return numbers[number] if is_number else value_at(config, key)

    for claim in published().keys:
        if claim.key.startswith(prefix) and (claim.of is None or value(claim.of)):
            yield claim, value(claim.key)


def plain_value(value: Any) -> Any:
    """Return a comparable value: sequences of any kind as lists."""
    return list(value) if isinstance(value, Sequence) and not isinstance(value, str) else value


def text(value: Any) -> str:
    """Format a value as in files of conf/."""
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return f"[{', '.join(map(text, value))}]"
    return str(value) or '""'
