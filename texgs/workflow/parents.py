"""The runs that the jobs of the workflow are recorded inside of: one for all, and one for each sweep."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from texgs.core.checksum import digest
from texgs.core.io import write_json
from texgs.workflow import tracking as track
from texgs.workflow.plan import Plan
from texgs.workflow.product import key_of
from texgs.workflow.provenance import git_revision, user

WHOLE = ""  # the run of the workflow among those of its sweeps


def runs_file(results: str) -> str:
    """Return the file that tells jobs which run they are inside of, and their swept values."""
    return f"{results}/.conf/runs.json"


def begin(plan: Plan, words: tuple[str, ...]) -> dict[str, track.Run]:
    """Begin the runs of a plan by the names of its sweeps, and write the file that jobs read.

    The same command in the same place goes on with the runs that it had.

    Args:
        plan: of the run.
        words: overrides of the configuration, which it was made of.
    """
    place = Path(plan.results).absolute().as_posix()
    key = digest("\n".join([place, *words]))
    common = {"mlflow.user": user(), "git.sha": git_revision(), "output": place}

    def run(name: str, title: str, tags: Mapping[str, str], params: Mapping[str, object]) -> track.Run:
        own = {**common, **tags}
        return track.begin(
            plan.tracking,
            experiment=plan.experiment,
            name=title,
            tags=own,
            params=params,
            key=f"{key} {name}",
        )

    groups = " ".join(word for word in words if "." not in key_of(word))
    values = {key_of(word): word.partition("=")[2] for word in words}
    runs = {WHOLE: run(WHOLE, groups or "texgs", {"stage": "workflow"}, values)}
    for name in filter(None, plan.sweeps):
        keys = {key for folder in plan.sweeps[name] for key in plan.jobs[folder]["swept"]}
        tags = {"stage": "sweep", "sweep": name, track.PARENT: str(runs[WHOLE].id)}
        runs[name] = run(name, f"sweep {name}", tags, {"keys": ", ".join(sorted(keys))})
    if plan.tracking is not None:
        jobs = plan.jobs.items()
        told = {x: {"parent": runs[owner(plan, x)].id, "swept": job["swept"]} for x, job in jobs}
        write_json(runs_file(plan.results), told)
    return runs


def end(runs: Mapping[str, track.Run], status: str, plan: Plan, made: Iterable[str]) -> None:
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


def owner(plan: Plan, folder: str) -> str:
    """Return the sweep that a job is of; that of the whole where it is of several, or of none."""
    names = [name for name, folders in plan.sweeps.items() if folder in folders]
    return names[0] if len(names) == 1 else WHOLE
