"""What measures of edits depend on: how many views of the test path measure, against all of them.

`python -m benchmarks.measures OUTPUT.csv EDIT,EDIT... COUNT,COUNT... KEY=VALUE...` measures edits that
`texgs run KEY=VALUE...` has made, by so many views each; the last count is what others are compared with.
"""

from __future__ import annotations

import pandas as pd

from benchmarks.command import call
from texgs.cli.main import main as texgs
from texgs.config.compose import compose
from texgs.core.io import read_json
from texgs.workflow.stage_table import STAGES

MEASURED = ("short_rmse", "long_rmse", "short_lpips", "long_lpips", "style_nnfm", "style_gram")


def main(output: str, edits: str, counts: str, *words: str) -> None:
    """Measure, print and write a row for each edit and count."""
    rows = [measured(edit, count, *words) for edit in edits.split(",") for count in counts.split(",")]
    table = pd.DataFrame(rows)
    last = table.groupby("edit")[list(MEASURED)].transform("last")
    table["largest difference"] = (table[list(MEASURED)] - last).abs().max(axis=1)
    table = table.round(5)
    print(table.to_string(index=False))
    table.to_csv(output, index=False, lineterminator="\n")


def measured(edit: str, count: str, *words: str) -> dict[str, object]:
    """Return what so many views say about an edit."""
    given = (*words, f"edit={edit}", f"metric.views={count}")
    texgs(["edit_metrics", *given])
    config = compose(given)
    numbers = read_json(STAGES["edit_metrics"].output(config) / "metrics.json")["numbers"]
    size = f"{config.views.width}x{config.views.height}"
    found = {name: numbers.get(name, float("nan")) for name in MEASURED}
    return {"data": config.dataset.name, "pixels": size, "edit": edit, "views": numbers["views"], **found}


if __name__ == "__main__":
    call(main, "benchmarks.measures edit_metrics")
