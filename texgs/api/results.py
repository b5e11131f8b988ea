"""The numbers of all jobs below a folder of results as one table of pandas."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from texgs.core.errors import ArgumentError
from texgs.report.metrics_files import below, read_known
from texgs.report.results import plain

if TYPE_CHECKING:
    import pandas

FACTS = ("dataset", "tf", "stage", "recipe", "variant", "sweep", "seed")  # columns before the numbers


def results(folder: str | Path = "results") -> pandas.DataFrame:
    """Return a row for each job of `texgs run`: what it is of, its seconds, and its numbers.

    Columns are `FACTS`, `edit`, `job_seconds` and all numbers by their names in metrics.json, such as `psnr`;
    what a job has not is missing there. Lists are left out.

    Raises:
        ArgumentError: if there are no results in the folder, or all are of another version of texgs.
    """
    import pandas

    import_module("texgs.workflow.stage_table")  # results of stages' own are defined in their modules
    records, _ = read_known(below(folder))
    if not records:
        raise ArgumentError(f"{folder}: expected results of texgs run, got none; name their folder")
    rows = []
    for record in records:
        facts = {name: getattr(record, name) for name in FACTS}
        facts |= {"edit": record.facts.get("edit"), "job_seconds": record.facts.get("seconds")}
        numbers = plain(record.result)
        rows.append(facts | {key: x for key, x in numbers.items() if isinstance(x, int | float | str)})
    return pandas.DataFrame(rows)
