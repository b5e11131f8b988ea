"""The numbers of all jobs below a folder of results as one table of pandas."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING

from texgs.core.errors import ArgumentError
from texgs.report.metrics_files import require_apart
from texgs.report.results import as_mapping
from texgs.workflow.graph import current_records

if TYPE_CHECKING:
    import pandas

FACTS = ("dataset", "tf", "stage", "recipe", "variant", "sweep", "seed")  # columns before the numbers


def results(folder: str | Path = "results") -> pandas.DataFrame:
    """Return a row for each job of `texgs run`: what it is of, its seconds, and its numbers.

    Columns are `FACTS`, `edit`, `job_seconds` and all numbers by their names in metrics.json, such as `psnr`;
    what a job has not is missing there. Lists are left out. A warning tells of each result that is damaged or
    comes from one that has been made anew since; these have no rows.

    Raises:
        ArgumentError: if there are no results in the folder, all are of another version of texgs, or two
            folders in it have those of the same job.
    """
    import pandas

    records, left_out = current_records(folder)
    for entry in left_out:
        warnings.warn(f"left out: {entry}", stacklevel=2)
    if not records:
        raise ArgumentError(f"{folder}: expected results of texgs run, got none; name their folder")
    require_apart(records)
    rows = []
    for record in records:
        facts = {name: getattr(record, name) for name in FACTS}
        facts |= {"edit": record.facts.get("edit"), "job_seconds": record.facts.get("seconds")}
        numbers = as_mapping(record.result)
        rows.append(facts | {key: x for key, x in numbers.items() if isinstance(x, int | float | str)})
    return pandas.DataFrame(rows)
