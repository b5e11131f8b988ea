"""The tables of a report in their order: first the paper's, then ours."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from texgs.report.edit_tables import image_driven, looks, text_driven, text_driven_frozen
from texgs.report.fit_tables import ablation, fits, fitting, meshes, model_size
from texgs.report.metrics_files import LeftOut, Record, note
from texgs.report.results import EditResult, FitResult
from texgs.report.scene_tables import cuts, datasets, edits, rendering, steps
from texgs.report.sweep_table import sweep
from texgs.report.table import Table


@dataclass(frozen=True)
class TableSpec:
    """A table of the report: what it is called, and how it is made of records."""

    name: str  # of its files
    title: str
    caption: str
    section: str  # of the report, a key of `texgs.report.sections.SECTIONS`
    places: tuple[str, ...]  # of the jobs that it reads, names of rules of the workflow
    make: Callable[[Sequence[Record[Any]]], Table] | None  # None: whoever writes the tables hands it in
    number: str = ""  # in the paper, with A in its appendix; none for tables that it does not have
    paper: str = ""  # what else it has of this

    @property
    def heading(self) -> str:
        """Return number and title."""
        return f"Table {self.number}. {self.title}" if self.number else self.title

    def table(
        self, records: Sequence[Record[Any]], left_out: Sequence[LeftOut] = (), given: Table | None = None
    ) -> Table:
        """Return the table of some jobs, or the given one; its caption says what it shows and lacks."""
        made = self.make(records) if self.make else given or Table("", [], [])
        where = f"In the paper: {self.paper}." if self.paper else ""
        parts = (self.caption, where, made.caption, note(left_out, self.places))
        return replace(made, heading=self.heading, caption=" ".join(filter(None, parts)))


EDITED = ("edit", "edit_metrics")
VARIED = "Training and test views after the last phase, means over basic scenes; minutes of all phases."
PAPERS = (
    TableSpec(
        "datasets",
        "Data sets",
        "Data sets with their settings, and the time of a frame of the volume renderer.",
        "data",
        ("volume", "views", "sheet"),
        datasets,
        "1",
        "Table 1, and Table A3 for the last four data sets",
    ),
    TableSpec(
        "image_driven",
        "Image-driven editing",
        "Minutes of editing, size of the model, mean and largest time of a frame, and primitives.",
        "image",
        EDITED,
        image_driven,
        "2",
    ),
    TableSpec(
        "text_driven",
        "Text-driven editing",
        "CLIP similarity and directional similarity, minutes of editing, mean and largest time of a frame, "
        "size of the model, and primitives.",
        "text",
        EDITED,
        text_driven,
        "3",
    ),
    TableSpec(
        "views",
        "Numbers of training views",
        VARIED,
        "ablations",
        ("phase",),
        partial(ablation, sweep="views"),
        "A1",
    ),
    TableSpec(
        "resolution",
        "Sizes of training images",
        VARIED,
        "ablations",
        ("phase",),
        partial(ablation, sweep="resolution"),
        "A2",
    ),
    TableSpec(
        "model_size",
        "Model size",
        "Sums over the basic scenes of a data set, 32 bits a value; 16 for harmonics of voxels.",
        "sizes",
        ("phase",),
        model_size,
        "A4",
    ),
    TableSpec(
        "fitting",
        "Fitting, phase by phase",
        "Test views after each phase, means over the basic scenes; minutes of the phase itself.",
        "fitting",
        ("phase",),
        fitting,
        "A5",
    ),
)
STUDY = TableSpec("user_study", "User study", "", "study", EDITED, None, "A6")
OURS = (
    TableSpec(
        "text_driven_frozen",
        "Text-driven editing, geometry frozen",
        "As Table 3, for methods whose geometry stays as it was fitted.",
        "text",
        EDITED,
        text_driven_frozen,
        paper="a figure of the appendix, without numbers",
    ),
    TableSpec("fits", "Fits of basic transfer functions", "", "fitting", ("phase",), fits),
    TableSpec(
        "rendering",
        "Rendering",
        "Frames of scenes as fitted, spread over the test path, beside those of the volume in the same job.",
        "rendering",
        ("timing",),
        rendering,
        paper="columns of Tables 1 to 3: edited scenes on an RTX 4090, and volumes by ParaView",
    ),
    TableSpec(
        "edits",
        "Edits by numbers against the volume",
        "Views around the object; nothing is trained for an edit.",
        "pse",
        ("pse",),
        edits,
    ),
    TableSpec(
        "cuts",
        "Cuts",
        "Planes that face the camera, each against the volume with the same cut: PSNR of all pixels, of the "
        "face that the cut opens, and of a band along its edge, means, and what a tenth of the planes misses."
        "  `slab` is how scenes with looks are shown; scenes without show the volume itself.",
        "cuts",
        ("cuts",),
        cuts,
    ),
    TableSpec(
        "steps",
        "Series in time",
        "Steps that are followed from the fitted one, each against its volume.",
        "time",
        ("steps",),
        steps,
    ),
    TableSpec("looks", "All measures of all edits", "", "more", EDITED, looks),
    TableSpec("meshes", "Meshes", "", "fitting", ("mesh",), meshes),
    TableSpec("differences", "Where we differ", "", "differences", ("phase", "edit", "sheet"), None),
)


def specs(sweeps: Iterable[str] = ()) -> list[TableSpec]:
    """Return all tables, with one for each of some sweeps."""
    return [*PAPERS, STUDY, *OURS, *map(of_sweep, sweeps)]


def of_sweep(name: str) -> TableSpec:
    """Return the table of a sweep, with the spread over its seeds."""
    places, make = ("phase", *EDITED), partial(sweep, name=name)
    return TableSpec(f"sweep-{name}", f"Sweep {name}", "", "ablations", places, make)


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
