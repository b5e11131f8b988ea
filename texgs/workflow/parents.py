"""The runs that the jobs of the workflow are recorded inside of: one for all, and one for each sweep."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from texgs.core.checksum import digest
from texgs.core.io import write_json
from texgs.workflow.plan import Plan
from texgs.workflow.product import key_of
from texgs.workflow.provenance import git_revision, user
from texgs.workflow.tracking import Parent, Run, open_parents

WHOLE = ""  # the run of the workflow among those of its sweeps


def runs_file(results: str) -> str:
    """The file that tells jobs which run they are inside of, and what tells their variant from others."""
    return f"{results}/.conf/runs.json"


def begin(plan: Plan, words: tuple[str, ...]) -> dict[str, Run]:
    """Begin the runs of a plan by the names of its sweeps, and write the file that jobs read.

    The same command in the same place goes on with the runs that it had.

    Args:
        plan: of the run.
        words: overrides of the configuration, which it was made of.

    Raises:
        ArgumentError, TrackingError: if the tracking store cannot be used.
    """
    place = Path(plan.results).absolute().as_posix()
    sweeps = {name: of_sweep(plan, name) for name in plan.sweeps if name}
    groups = " ".join(word for word in words if "." not in key_of(word))
    whole = Parent(groups or "texgs", common("workflow", place), {key_of(x): value(x) for x in words})
    runs = open_parents(
        plan.tracking, plan.experiment, digest("\n".join([place, *words])), {WHOLE: whole, **sweeps}
    )
    if plan.tracking is not None:
        told = {
            folder: {"parent": runs[owner(plan, folder)].id, "swept": job["swept"]}
            for folder, job in plan.jobs.items()
        }
        write_json(runs_file(plan.results), told)
    return runs


def end(runs: Mapping[str, Run], status: str, plan: Plan, made: Iterable[str]) -> None:
    """End the runs, with the tables and the report among the files that the workflow makes.

    Args:
        runs: what `begin` returned.
        status: FINISHED or FAILED.
        plan: of the run.
        made: files, some of which may not be there.
    """
    files = [Path(file) for file in sorted(made) if Path(file).is_file()]
    tables, report = Path(plan.results, "tables"), Path(plan.results, "report.html")
    for name, run in reversed([*runs.items()]):
        for file in files:
            if file.parent == tables and (name == WHOLE or file.stem == f"sweep-{name}"):
                run.artifact(file, tables.name)
            elif file == report and name == WHOLE:
                run.artifact(file)
        run.end(status)


def of_sweep(plan: Plan, name: str) -> Parent:
    """The run of a sweep, with the keys that its variants differ in."""
    keys = {key for folder in plan.sweeps[name] for key in plan.jobs[folder]["swept"]}
    tags = {**common("sweep", Path(plan.results).absolute().as_posix()), "sweep": name}
    return Parent(f"sweep {name}", tags, {"keys": ", ".join(sorted(keys))})


def common(stage: str, place: str) -> dict[str, str]:
    """Tags of both."""
    return {"mlflow.user": user(), "git.sha": git_revision(), "stage": stage, "output": place}


def owner(plan: Plan, folder: str) -> str:
    """The sweep that a job is of; that of the whole where it is of several, or of none."""
    names = [name for name, folders in plan.sweeps.items() if folder in folders]
    return names[0] if len(names) == 1 else WHOLE


def value(word: str) -> str:
    """What an override gives its key."""
    return word.partition("=")[2]
