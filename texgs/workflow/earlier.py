"""Results of earlier runs in the same folder: what tables and the report show beside those of a run."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from texgs.core.io import read_json
from texgs.report.metrics_files import below
from texgs.workflow.experiments import LeftOut
from texgs.workflow.result import METRICS, fingerprint, is_complete
from texgs.workflow.stage_table import STAGES

if TYPE_CHECKING:
    from texgs.core.checksum import Checksums
    from texgs.workflow.graph import Graph


def earlier(
    results: str, graph: Graph, checksums: Checksums
) -> tuple[dict[str, str], dict[LeftOut, list[str]]]:
    """Return the whole results that a run does not make.

    Returns:
        Their metrics files with digests of the contents, but for results made from others that have been
        replaced since, or will be by this run; and these results, with their places.
    """
    digests: dict[str, str] = {}
    outdated: dict[LeftOut, list[str]] = {}
    for folder in sorted({path.parent.as_posix() for path in below(results)} - set(graph.run)):
        if not is_complete(Path(folder), checksums):
            continue
        file = Path(folder, METRICS)
        facts = read_json(file)
        sources = facts.get("made_from", {})  # not told by versions of texgs before this
        changed = (
            path for name, path in sources.items() if is_other(path, facts["inputs"][name], graph, checksums)
        )
        if source := next(changed, None):
            why = f"comes from {Path(source).parent}, which has been made anew since; run its job again"
            outdated[LeftOut(folder, why)] = [STAGES[facts["stage"]].place]
        else:
            digests[file.as_posix()] = checksums.of(file)
    return digests, outdated


def is_other(file: str, was: str, graph: Graph, checksums: Checksums) -> bool:
    """Return whether a file of a result is or will be another one than a result was made from.

    Args:
        file: its path; one that is not there counts as it was.
        was: its fingerprint then.
        graph: of this run.
        checksums: what is known of files.
    """
    path = Path(file)
    return path.is_file() and (
        fingerprint(path, checksums) != was or graph.is_replaced(path.parent.as_posix())
    )
