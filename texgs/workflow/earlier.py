"""Results of earlier runs in the same folder: what tables and the report show beside those of a run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from texgs.core.io import read_json
from texgs.report.metrics_files import below
from texgs.workflow.experiments import LeftOut
from texgs.workflow.result import METRICS, fingerprint, is_complete, stamped
from texgs.workflow.stage import settings_digest
from texgs.workflow.stage_table import STAGES

if TYPE_CHECKING:
    from texgs.core.checksum import Checksums
    from texgs.workflow.job import Job


def earlier(
    results: str, jobs: Mapping[str, Job], checksums: Checksums
) -> tuple[dict[str, str], dict[LeftOut, list[str]]]:
    """The whole results that none of these jobs makes.

    Returns:
        Their metrics files with digests of the contents, but for results made from others that have been
        replaced since, or will be by this run; and these results, with their places.
    """
    known: dict[str, bool] = {}
    digests: dict[str, str] = {}
    outdated: dict[LeftOut, list[str]] = {}
    for folder in sorted({path.parent.as_posix() for path in below(results)} - set(jobs)):
        if not is_complete(Path(folder), checksums):
            continue
        file = Path(folder, METRICS)
        facts = read_json(file)
        sources = facts.get("made_from", {})  # not told by versions of texgs before this
        changed = (
            path
            for name, path in sources.items()
            if is_other(path, facts["inputs"][name], jobs, checksums, known)
        )
        if source := next(changed, None):
            why = f"comes from {Path(source).parent}, which has been made anew since; run its job again"
            outdated[LeftOut(folder, why)] = [STAGES[facts["stage"]].place]
        else:
            digests[file.as_posix()] = checksums.of(file)
    return digests, outdated


def of_other_settings(jobs: Iterable[Job]) -> list[str]:
    """The folders of jobs that hold results of other settings, which the jobs will replace."""
    return sorted(
        job.output.as_posix()
        for job in jobs
        if (job.output / METRICS).exists()
        and (stamped(job.output) or {}).get("settings") != settings_digest(job.settings)
    )


def is_other(
    file: str, was: str, jobs: Mapping[str, Job], checksums: Checksums, known: dict[str, bool]
) -> bool:
    """Whether a file of a result is not what another result was made from, or will not be after this run.

    Args:
        file: its path; one that is not there counts as it was.
        was: its fingerprint then.
        jobs: of this run, by folder.
        checksums: what is known of files.
        known: which of their results the run replaces, filled as it is asked.
    """
    path = Path(file)
    return path.is_file() and (
        fingerprint(path, checksums) != was or is_replaced(path.parent.as_posix(), jobs, known)
    )


def is_replaced(folder: str, jobs: Mapping[str, Job], known: dict[str, bool]) -> bool:
    """Whether a run puts the result of another job into a folder, or one that comes from such a result."""
    if folder not in jobs:
        return False
    if folder not in known:
        files = jobs[folder].inputs.values()
        known[folder] = (
            not all(path.exists() for path in files)
            or stamped(jobs[folder].output) != jobs[folder].identity()
            or any(is_replaced(path.parent.as_posix(), jobs, known) for path in files)
        )
    return known[folder]
