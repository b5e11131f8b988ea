"""The tables of a report in their order: first the paper's, then ours."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from texgs.report.edit_tables import image_driven, looks, text_driven, text_driven_frozen
from texgs.report.fit_tables import VARIANTS, ablation, fits, fitting, meshes, model_size
from texgs.report.metrics_files import LeftOut, Record, note
from texgs.report.published import are_of_paper
from texgs.report.results import EditResult, FitResult
from texgs.report.scene_tables import datasets, edits, rendering, steps
from texgs.report.sweep_table import sweep
from texgs.report.table import PAPER, UNLIKE_CELL, Table, tables_file

COMPARED_FACTS = (
    "Numbers of the paper stand beside ours where recipe, size of images and number of training views are "
    f"the paper's; elsewhere there is {UNLIKE_CELL}, not like for like. Its transfer functions are not "
    "published: even there scenes differ, so that PSNR, SSIM and primitives are not like for like."
)


@dataclass(frozen=True)
class TableSpec:
    """A table of the report: its entry in tables.yaml, and the function that makes it from records."""

    name: str  # of its files
    title: str
    section: str  # of the report, a key of `texgs.report.results.SECTIONS`
    places: Sequence[str]  # rules of the workflow whose jobs it reads
    make: Callable[[Sequence[Record[Any]]], Table] | None  # None: supplied by the caller
    caption: str = ""
    number: str = ""  # in the paper, with A in its appendix; "" for other tables
    paper: str = ""  # sentences on the paper's table

    def table(
        self, records: Sequence[Record[Any]], left_out: Sequence[LeftOut] = (), given: Table | None = None
    ) -> Table:
        """Return the table of some jobs, or the given one; its caption says what it shows and lacks.

        Only beside data of the paper, title and caption say where the paper has the table.
        """
        made = self.make(records) if self.make else given or Table("", [], [])
        heading, where = self.title, ""
        if are_of_paper(records):
            heading += f" (Table {self.number} of the paper)" if self.number else ""
            where = self.paper or COMPARED_FACTS * any(each.title.endswith(PAPER) for each in made.columns)
        parts = (self.caption, where, made.caption, note(left_out, self.places))
        shown = [each for each in made.columns if not each.title.endswith(PAPER) or made.has(each.title)]
        return replace(made, columns=shown, heading=heading, caption=" ".join(filter(None, parts)))


MAKERS: dict[str, Callable[[Sequence[Record[Any]]], Table]] = {
    **{make.__name__: make for make in (datasets, image_driven, text_driven, text_driven_frozen, looks)},
    **{make.__name__: make for make in (fitting, fits, model_size, meshes, rendering, edits, steps)},
    **{sweep: partial(ablation, sweep=sweep) for sweep in VARIANTS},
}


def specs(sweeps: Iterable[str] = ()) -> list[TableSpec]:
    """Return all tables, with one for each of some sweeps."""
    return [*map(spec_of, tables_file()), *map(of_sweep, sweeps)]


def spec_of(name: str) -> TableSpec:
    """Return a table of tables.yaml."""
    words = {key: value for key, value in tables_file()[name].items() if key != "columns"}
    return TableSpec(name, make=MAKERS.get(name), **words)


def of_sweep(name: str) -> TableSpec:
    """Return the table of a sweep, with the spread over its seeds."""
    places, make = ("phase", "edit", "edit_metrics"), partial(sweep, name=name)
    return TableSpec(f"sweep-{name}", f"Sweep {name}", "ablations", places, make)


def sweeps_of(records: Iterable[Record[Any]]) -> list[str]:
    """Return the sweeps among some jobs whose fits or edits can be compared, each once."""
    compared = [record for record in records if isinstance(record.result, FitResult | EditResult)]
    return sorted({record.sweep for record in compared if record.is_swept and record.variant})


def tables_of(
    records: Sequence[Record[Any]], left_out: Sequence[LeftOut] = (), given: Mapping[str, Table] | None = None
) -> dict[str, Table]:
    """Return all tables of some jobs by their names, also empty ones; `given` need more than records."""
    own, listed = given or {}, specs(sweeps_of(records))
    return {spec.name: spec.table(records, left_out, own.get(spec.name)) for spec in listed}
