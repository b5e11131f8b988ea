"""Read and check the metrics files of jobs, and the list of missing jobs."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

from texgs.config.schema import NO_SWEEP
from texgs.core.errors import ArgumentError
from texgs.core.io import read_json
from texgs.core.keys import MissingKey, UnknownKey, ValueMismatch, typed
from texgs.core.names import METRICS
from texgs.metrics.metric import metrics
from texgs.report.results import EditMeasures, Result

ARTIFACTS = "mlartifacts"  # folder of MLflow's files of runs
WORDS = ("stage", "dataset", "field", "variant", "sweep", "stand_in", "command", "result")
FACTS: dict[str, tuple[Any, str]] = {  # what a metrics file holds beside its numbers, as far as it is read
    **dict.fromkeys((*WORDS, "tf", "recipe"), (str, "words")),
    **dict.fromkeys(("seed", "fit_seed"), (int, "a whole number")),
    **dict.fromkeys(("seconds", "peak_memory_mib"), (int | float, "a number")),
    **dict.fromkeys(("numbers", "pictures", "versions"), (dict, "values by name")),
}
R_co = TypeVar("R_co", bound=Result, covariant=True)


@dataclass(frozen=True)
class Record(Generic[R_co]):
    """A job: its result, and facts about it."""

    path: Path  # its metrics.json
    stage: str
    dataset: str
    tf: str | None  # None for jobs of a whole data set
    label: str  # recipe, variant and seeds other than 0, as in tables; empty for jobs before a fit
    field: str  # kind of field
    variant: str
    sweep: str
    seed: int
    stand_in: str  # data set that this one replaces, or ""
    result: R_co
    facts: dict[str, Any]  # the file, for its times, versions and digests

    @property
    def recipe(self) -> str:
        """Return the name of the recipe of the fit; empty for jobs before a fit."""
        return str(self.facts.get("recipe") or "")

    @property
    def title(self) -> str:
        """Return the name of the data set in tables."""
        return f"{self.dataset}, stand-in for {self.stand_in}" if self.stand_in else self.dataset

    @property
    def is_swept(self) -> bool:
        """Return whether this is a job of a sweep, which has a separate table."""
        return self.sweep not in ("", NO_SWEEP)


@dataclass(frozen=True)
class LeftOut:
    """Something missing from a run."""

    what: str  # such as "data set wood"
    why: str  # one sentence
    places: list[str]  # rules of the workflow whose jobs are missing

    def __str__(self) -> str:
        why = self.why.removeprefix(f"{self.what}: ")  # avoids naming it twice
        return f"{self.what}: {why.rstrip('. ')}."


class OtherVersionError(ArgumentError):
    """A metrics file comes from another version of texgs."""


def read_known(paths: Iterable[str | Path]) -> tuple[list[Record[Any]], list[LeftOut]]:
    """Read the metrics of this version of texgs, in the order of their paths; say how many are of others."""
    records: list[Record[Any]] = []
    others: dict[Path, OtherVersionError] = {}
    for path in sorted(map(Path, paths)):
        try:
            records.append(_record(path))
        except OtherVersionError as error:
            others[path] = error
    if not others:
        return records, []
    first = next(iter(others))
    if not records:
        raise others[first]
    what = f"{len(others)} metrics files" if len(others) > 1 else "1 metrics file"
    why = f"of another version of texgs, {first} first; run its job again to have it back"
    return records, [LeftOut(what, why, [])]


def place_of(record: Record[Any]) -> tuple[str, ...]:
    """Return the parts of a path from the folder of the data set on; a project may have the same name."""
    parts, below = record.path.parts, {record.tf, "scene", "volume", "transfer", "gallery"}
    places = [parts[index:] for index, part in enumerate(parts[:-1]) if part == record.dataset]
    return next((each for each in places if each[1] in below), parts)


def require_apart(records: Iterable[Record[Any]]) -> None:
    """Require that no two results are of the same job in different folders: numbers of both would mix."""
    known: dict[tuple[str, ...], Path] = {}
    for record in records:
        place = place_of(record)
        if (other := known.setdefault(place, record.path)) != record.path:
            raise ArgumentError(
                f"{record.path}: expected results of one folder, got those of the same job in {other}, too; "
                "move one of them away, or give the files of one folder"
            )


def read_left_out(path: str | Path | None) -> list[LeftOut]:
    """Read the list of missing parts from a file; empty without a file."""
    if path is None or not Path(path).exists():
        return []
    entries = read_json(path)
    if not isinstance(entries, list):
        raise ArgumentError(f"{path}: expected a list of what was left out, got {type(entries).__name__}")
    try:
        return [typed(LeftOut, entry) for entry in entries]
    except ValueMismatch as error:
        raise ArgumentError(f"{path}: expected entries with what, why and places, got others") from error


def note(left_out: Iterable[LeftOut], places: Collection[str]) -> str:
    """Describe the missing parts of a table, or ""."""
    entries = [str(entry) for entry in left_out if set(entry.places) & set(places)]
    return " ".join(["Left out:", *entries]) if entries else ""


def of(kind: type[R_co], records: Iterable[Record[Any]]) -> list[Record[R_co]]:
    """Select the records with a result of one kind."""
    return [record for record in records if isinstance(record.result, kind)]


def below(folder: str | Path) -> list[Path]:
    """Find the metrics files of all results in a folder, not of jobs at work or copies of tracked runs."""

    def is_aside(name: str) -> bool:
        return name.startswith(".") or name == ARTIFACTS

    paths = Path(folder).rglob(METRICS)
    return sorted(path for path in paths if not any(map(is_aside, path.relative_to(folder).parts)))


def _record(path: Path) -> Record[Any]:
    """Read one metrics file."""
    facts = read_json(path)
    if not isinstance(facts, dict) or "numbers" not in facts:
        raise ArgumentError(f"{path}: expected the metrics of a job, got something else")
    _check(path, facts)
    try:
        result = Result.kinds[facts["result"]].of(facts["numbers"])
        if isinstance(result, EditMeasures):
            _check_values(path, result.values)
        stage, dataset = facts["stage"], facts["dataset"]
    except (KeyError, UnknownKey, MissingKey) as error:
        raise OtherVersionError(
            f"{path}: expected the metrics of this version of texgs, got others; run the job again"
        ) from error
    except ValueMismatch as error:
        raise ArgumentError(f"{path}: numbers.{error}; run the job again") from error
    variant, seed = facts.get("variant", ""), facts.get("seed") or 0
    fit = (label(facts), facts.get("field", ""), variant, facts.get("sweep", ""), seed)
    return Record(path, stage, dataset, facts.get("tf"), *fit, facts.get("stand_in", ""), result, facts)


def _check(path: Path, facts: Mapping[str, Any]) -> None:
    """Require facts of the types that they are written with; those that are missing or null count as such."""
    for key, (kind, words) in FACTS.items():
        value = facts.get(key)
        if value is not None and (not isinstance(value, kind) or isinstance(value, bool)):
            raise ArgumentError(f"{path}: {key}: expected {words}, got {value!r:.60}; run the job again")
        if value is None and key in WORDS and key in facts:
            raise ArgumentError(f"{path}: {key}: expected words, got null; run the job again")


def _check_values(path: Path, values: Mapping[str, Any]) -> None:
    """Require values of the metrics that there are: numbers for measures, words for notes, tables."""
    kinds: dict[str, tuple[Any, str]] = {}
    for metric in metrics().values():
        kinds |= dict.fromkeys((measure.name for measure in metric.measures), (int | float, "a number"))
        kinds |= dict.fromkeys(metric.notes or {}, (str, "words"))
        kinds |= dict.fromkeys(metric.tables, (dict, "numbers by name"))
    for key, value in values.items():
        kind, words = kinds[key]
        numbers = value.values() if isinstance(value, dict) else ()
        if not isinstance(value, kind) or not all(isinstance(x, int | float) for x in numbers):
            got = f"expected {words}, got {value!r:.60}"
            raise ArgumentError(f"{path}: numbers.{key}: {got}; run the job again")


def label(facts: Mapping[str, Any]) -> str:
    """Return recipe, variant, seed of the fit and seed of the edit of a job, those that are not 0."""
    recipe, seed = facts.get("recipe", ""), facts.get("seed") or 0
    if not recipe:
        return ""
    by_letter = {"s": facts.get("fit_seed", 0), "e": seed} if "edit" in facts else {"s": seed}
    seeds = (f"{letter}{number}" for letter, number in by_letter.items() if number)
    return "-".join(filter(None, (recipe, facts.get("variant", ""), *seeds)))
