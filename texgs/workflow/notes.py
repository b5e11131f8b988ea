"""Notes on results that are not as they should be, in files of RESULTS/.conf that their jobs read.

Snakemake knows of inputs and parameters. That a result is damaged, or that a job failed and left the result
before it in place, it learns by a note: it takes an input for changed where its contents are.
"""

import os
from collections.abc import Iterable
from datetime import datetime
from pathlib import Path

from texgs.core.cache import Checksums, keep, recall, sha256
from texgs.core.io import write_bytes
from texgs.core.names import METRICS
from texgs.workflow.job import Job

LONG_AGO = 946684800  # the year 2000, in seconds


def write_note(file: str, note: str) -> None:
    """Write a note with the time at the end of a file, in place of the one before; an empty one takes it off.

    Without a note the file is made older than any result: the job that read it with one needs no second run.
    """
    path = Path(file)
    text = path.read_text(encoding="utf-8")
    kept = "".join(line for line in text.splitlines(keepends=True) if not line.startswith("#"))
    if note:
        kept += f"# {datetime.now().isoformat(timespec='microseconds')} {note}\n"
    if kept != text:
        write_bytes(path, kept.encode())
        if not note:
            os.utime(path, (LONG_AGO, LONG_AGO))


def note_results(jobs: Iterable[Job], settings: Iterable[str]) -> None:
    """Note in settings files, which several jobs may share, whether results that are there are theirs."""
    wrong: dict[str, list[str]] = {}
    for job, file in zip(jobs, settings, strict=True):
        if (job.output / METRICS).exists():
            wrong.setdefault(file, []).extend([] if job.is_done() else [str(job.output)])
    for file, outputs in wrong.items():
        write_note(file, f"{', '.join(outputs)}: not whole, or of another job" if outputs else "")


def note_tables(results: str, checksums: Checksums) -> dict[str, str]:
    """Note what of tables and the report has been changed since; return files of notes by rule."""
    made = recall(_written(results), "") or {}
    changed = [path for path, sha in made.items() if Path(path).exists() and checksums.of(Path(path)) != sha]
    files = {}
    for name, place in {"tables": f"{results}/tables", "report": f"{results}/report.html"}.items():
        files[name] = f"{results}/.conf/{name}.txt"
        if not Path(files[name]).exists():
            write_bytes(files[name], b"whole\n")
            os.utime(files[name], (LONG_AGO, LONG_AGO))
        own = ", ".join(sorted(path for path in changed if path.startswith(place)))
        write_note(files[name], f"{own}: changed since they were made" if own else "")
    return files


def note_written(results: str, made: Iterable[str]) -> None:
    """Keep the checksums of tables and the report, which a run has made, for the next one to compare."""
    known = recall(_written(results), "") or {}
    own = {path for path in made if path.startswith((f"{results}/tables/", f"{results}/report.html"))}
    there = sorted(path for path in own if Path(path).is_file())  # with --touch not all
    keep(_written(results), "", {**known, **{path: sha256(path) for path in there}})


def _written(results: str) -> Path:
    return Path(results, ".conf", "written.json")
