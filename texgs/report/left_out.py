"""What a run has left out, and why: tables and the report say it."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from texgs.core.errors import ArgumentError
from texgs.core.io import read_json
from texgs.core.keys import ValueMismatch, typed


@dataclass(frozen=True)
class LeftOut:
    """Something that is not there."""

    what: str  # such as "data set wood"
    why: str  # one sentence
    places: list[str]  # of the jobs that there are none of, names of rules of the workflow

    def __str__(self) -> str:
        why = self.why.removeprefix(f"{self.what}: ")  # sentences that name it themselves
        return f"{self.what}: {why.rstrip('. ')}."


def read_left_out(path: str | Path | None) -> list[LeftOut]:
    """Return what a file says was left out; nothing without a file.

    Raises:
        ArgumentError: if the file is no list of entries with `what`, `why` and `places`.
    """
    if path is None or not Path(path).exists():
        return []
    entries = read_json(path)
    if not isinstance(entries, list):
        raise ArgumentError(f"{path}: expected a list of what was left out, got {type(entries).__name__}")
    try:
        return [typed(LeftOut, entry) for entry in entries]
    except ValueMismatch as error:
        raise ArgumentError(f"{path}: expected entries with what, why and places, got others") from error


def others(paths: Sequence[Path]) -> list[LeftOut]:
    """Return the entry for metrics files of other versions of texgs; none where there are none."""
    if not paths:
        return []
    what = f"{len(paths)} metrics files" if len(paths) > 1 else "1 metrics file"
    why = f"of another version of texgs, {paths[0]} first; run its job again to have it back"
    return [LeftOut(what, why, [])]


def note(left_out: Iterable[LeftOut], places: Collection[str]) -> str:
    """Return what of a table is left out, in words; empty where all is there."""
    entries = [str(entry) for entry in left_out if set(entry.places) & set(places)]
    return " ".join(["Left out:", *entries]) if entries else ""
