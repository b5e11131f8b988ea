"""The metrics files of jobs, read and checked."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from types import UnionType
from typing import Any, Generic, TypeVar

from omegaconf.errors import OmegaConfBaseException

from texgs.config.schema import NO_SWEEP
from texgs.core.errors import ArgumentError
from texgs.core.io import read_json
from texgs.fit.kinds import fit_specs
from texgs.report.results import Result, result_of

COPIES = "mlartifacts"  # folder of the files that MLflow keeps of runs, see texgs/track/sqlite.py
REQUIRED = ("stage", "dataset", "device", "seconds", "peak_memory_mib", "versions")
OF_TYPES: dict[type | UnionType, tuple[str, ...]] = {  # what metrics files say of jobs beside their numbers
    str: (
        *("stage", "dataset", "tf", "recipe", "field", "variant", "sweep", "edit", "stand_in", "device"),
        *("config_sha", "code_sha", "git_sha", "run", "result"),
    ),
    int: ("seed", "fit_seed"),
    int | float: ("seconds", "peak_memory_mib"),
    dict: ("numbers", "pictures", "versions", "inputs", "made_from", "weights", "machine"),
}
R_co = TypeVar("R_co", bound=Result, covariant=True)


@dataclass(frozen=True)
class Record(Generic[R_co]):
    """A job: what it told, and what is known of it."""

    path: Path  # of metrics.json
    stage: str
    dataset: str
    tf: str | None  # None for jobs of a whole data set
    label: str  # recipe, variant and seeds other than 0, as in tables; empty for jobs before a fit
    field: str  # kind of the fit
    variant: str
    sweep: str
    seed: int
    stand_in: str  # what the data set stands in for; empty for those that are what they are called
    result: R_co
    facts: dict[str, Any]  # the file, for its times, versions and digests

    @property
    def recipe(self) -> str:
        """Name of the recipe of the fit; empty for jobs before a fit."""
        return str(self.facts.get("recipe") or "")

    @property
    def title(self) -> str:
        """The data set as tables name it."""
        return f"{self.dataset}, stand-in for {self.stand_in}" if self.stand_in else self.dataset

    @property
    def is_swept(self) -> bool:
        """Whether this is a job of a sweep, whose numbers are in tables of their own."""
        return self.sweep not in ("", NO_SWEEP)


class OtherVersionError(ArgumentError):
    """A metrics file is of another version of texgs."""


def read(paths: Iterable[str | Path]) -> list[Record[Any]]:
    """All metrics, in the order of their paths.

    Raises:
        ArgumentError: if a file is no metrics file, or of another version of texgs.
    """
    return [_record(path) for path in sorted(map(Path, paths))]


def read_known(paths: Iterable[str | Path]) -> tuple[list[Record[Any]], list[Path]]:
    """The metrics of this version of texgs, as `read`, and the files of other versions.

    Raises:
        ArgumentError: if a file is no metrics file, or all are of other versions.
    """
    records: list[Record[Any]] = []
    others: dict[Path, OtherVersionError] = {}
    for path in sorted(map(Path, paths)):
        try:
            records.append(_record(path))
        except OtherVersionError as error:
            others[path] = error
    if others and not records:
        raise next(iter(others.values()))
    return records, list(others)


def of(kind: type[R_co], records: Iterable[Record[Any]]) -> list[Record[R_co]]:
    """Those with a result of one kind."""
    return [record for record in records if isinstance(record.result, kind)]


def below(folder: str | Path) -> list[Path]:
    """The metrics files of all results in a folder, but for jobs at work and the copies of tracked runs."""
    paths = Path(folder).rglob("metrics.json")
    return sorted(path for path in paths if not any(map(is_aside, path.relative_to(folder).parts)))


def is_aside(folder: str) -> bool:
    """Whether a folder holds no results, by its name."""
    return folder.startswith(".") or folder == COPIES


def phases() -> list[str]:
    """The phases of all kinds of fields, in their order."""
    return [phase for kind in fit_specs().values() for phase in kind.phases]


def paper(name: str, keys: int = 1) -> dict[tuple[str, ...], dict[str, str]]:
    """The paper's numbers of a table, by the values of its first columns; none for other tables."""
    file = files("texgs.report").joinpath("paper", f"{name}.csv")
    if not file.is_file():
        return {}
    lines = [line for line in file.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    return {tuple(list(row.values())[:keys]): row for row in csv.DictReader(lines)}


def _record(path: Path) -> Record[Any]:
    facts = read_json(path)
    if not isinstance(facts, dict) or "numbers" not in facts:
        raise ArgumentError(f"{path}: expected the metrics of a job, got something else")
    for kind, names in OF_TYPES.items():
        for name in names:
            if facts.get(name) is not None and not isinstance(facts[name], kind):
                expected, got = getattr(kind, "__name__", "number"), type(facts[name]).__name__
                raise ArgumentError(f"{path}: {name}: expected {expected}, got {got}; run the job again")
    try:
        result = result_of(facts["result"], facts["numbers"])
        stage, dataset, *_ = [facts[name] for name in REQUIRED]
    except (KeyError, TypeError, ValueError, OmegaConfBaseException) as error:
        raise OtherVersionError(
            f"{path}: expected the metrics of this version of texgs, got others; run the job again"
        ) from error
    variant, sweep, field = (facts.get(name) or "" for name in ("variant", "sweep", "field"))
    fit = (label(facts), field, variant, sweep, facts.get("seed") or 0)
    return Record(path, stage, dataset, facts.get("tf"), *fit, facts.get("stand_in") or "", result, facts)


def label(facts: Mapping[str, Any]) -> str:
    """Recipe, variant, seed of the fit and seed of the edit of a job, those that are not 0."""
    recipe, seed = facts.get("recipe", ""), facts.get("seed") or 0
    if not recipe:
        return ""
    by_letter = {"s": facts.get("fit_seed", 0), "e": seed} if "edit" in facts else {"s": seed}
    seeds = (f"{letter}{number}" for letter, number in by_letter.items() if number)
    return "-".join(filter(None, (recipe, facts.get("variant", ""), *seeds)))
