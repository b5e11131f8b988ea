"""The runs of a sweep: what was measured of each fit and of each edit, by variant and seed."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from texgs.core.errors import ArgumentError
from texgs.fit.kinds import fit_specs
from texgs.report.metrics_files import Record, of
from texgs.report.results import EditMeasures, EditResult, FitResult

# Measures of fits and of edits, with the digits that they are written with.
OF_FITS = {"PSNR, training": 2, "PSNR": 2, "SSIM": 4, "minutes": 2, "memory GiB": 2, "primitives": 0}
MATERIAL = {"k_a": "ambient", "k_d": "diffuse", "k_s": "specular", "beta": "shininess"}
OF_EDITS = {
    "CLIP similarity": ("similarity", 3),
    "CLIP direction": ("direction", 3),
    "NNFM": ("style_nnfm", 3),
    "Gram": ("style_gram", 3),
    "RMSE, near": ("short_rmse", 4),
    "RMSE, far": ("long_rmse", 4),
    "LPIPS, near": ("short_lpips", 4),
    "LPIPS, far": ("long_lpips", 4),
    "mean ms": ("frame_mean_ms", 2),
    "max ms": ("frame_max_ms", 2),
    "MB": ("megabytes", 1),
    "primitives": ("primitives", 0),
}
DIGITS = {
    **OF_FITS,
    **dict.fromkeys(MATERIAL, 2),
    **{title: digits for title, (_, digits) in OF_EDITS.items()},
}


@dataclass(frozen=True)
class Run:
    """A fit with all its phases, or an edit: one seed of one variant."""

    dataset: str
    tf: str  # empty for edits, which are of all
    recipe: str
    edit: str  # empty for fits
    variant: str
    measures: dict[str, float | None] = field(
        default_factory=dict
    )  # by title; empty where a phase is missing
    sources: Sequence[Path] = ()

    @property
    def series(self) -> tuple[str, str, str, str]:
        """What the variants are of."""
        return self.dataset, self.tf, self.recipe, self.edit


def runs_of(records: Iterable[Record[Any]], name: str) -> list[Run]:
    """The runs of a sweep, fits before edits and variants in the order of their numbers or names.

    Raises:
        ArgumentError: if there is none.
    """
    own = [record for record in records if record.variant and record.sweep == name]
    runs = [*fits(of(FitResult, own)), *edits(own)]
    if not runs:
        raise ArgumentError(f"sweep {name}: no fit or edit of it among the metrics files; run it first")
    return sorted(runs, key=lambda run: (run.dataset, bool(run.edit), *run.series[1:], natural(run.variant)))


def fits(records: Iterable[Record[FitResult]]) -> list[Run]:
    """The runs of fits; what is measured is of the last phase."""
    groups: dict[tuple[str, ...], dict[str, Record[FitResult]]] = defaultdict(dict)
    for record in records:
        groups[record.dataset, str(record.tf), record.label][record.stage] = record
    runs = []
    for phases in groups.values():
        one = next(iter(phases.values()))
        key = (one.dataset, str(one.tf), one.facts["recipe"], "", one.variant)
        runs.append(Run(*key, measures_of_fit(phases), [record.path for record in phases.values()]))
    return runs


def measures_of_fit(phases: dict[str, Record[FitResult]]) -> dict[str, float | None]:
    """What was measured of a fit; nothing where a phase is missing."""
    last = next((kind.phases[-1] for kind in fit_specs().values() if set(kind.phases) <= set(phases)), None)
    if last is None:
        return {}
    result, records = phases[last].result, phases.values()
    own = [result.train_psnr, result.psnr, result.ssim, sum(each.result.fit_seconds for each in records) / 60]
    memory = max(each.facts["peak_memory_mib"] for each in records) / 1024
    material = phases["shading"].result.material if "shading" in phases else {}
    return {
        **dict(zip(OF_FITS, [*own, memory, result.primitives], strict=True)),
        **{title: material.get(name) for title, name in MATERIAL.items()},
    }


def edits(records: Sequence[Record[Any]]) -> list[Run]:
    """The runs of edits, with what was measured of those with a new look."""
    measured = {(each.dataset, each.label, each.result.edit): each for each in of(EditMeasures, records)}
    runs = []
    for record in of(EditResult, records):
        metrics = measured.get((record.dataset, record.label, record.result.edit))
        measures: dict[str, float | None] = {"minutes": record.result.edit_seconds / 60}
        for title, (name, _) in OF_EDITS.items():
            measures[title] = getattr(metrics.result, name) if metrics else None
        key = (record.dataset, "", record.facts["recipe"], record.result.edit, record.variant)
        runs.append(Run(*key, measures, [record.path, *([metrics.path] if metrics else [])]))
    return runs


def natural(name: str) -> tuple[float, str]:
    """Numbers in their order before words."""
    value = number(name)
    return (float("inf"), name) if value is None else (value, "")


def number(name: str) -> float | None:
    """The value that a variant is named after; None where that is no number."""
    try:
        return float(name) if name[:1] in "-.0123456789" else None
    except ValueError:
        return None
