"""What MLflow is told: a run for each job, inside of one for the workflow or for a sweep of it."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING, Any

from texgs.config.schema import NO_SWEEP
from texgs.core.cache import digest
from texgs.core.io import write_json
from texgs.report.metrics_files import label
from texgs.workflow import result
from texgs.workflow.provenance import facts, git_revision, user
from texgs.workflow.runs import OUTPUT, PARENT, Run, begin

if TYPE_CHECKING:
    from texgs.workflow.job import Job
    from texgs.workflow.plan import Plan

RUNS = "TEXGS_RUNS"  # environment variable: the file of `runs_file`
WHOLE = ""  # the run of the workflow among those of its sweeps


@dataclass(frozen=True)
class Tracking:
    """Where the run of a job is recorded."""

    uri: str | None  # of the store; None: nowhere
    experiment: str
    parent: str | None = None  # identifier of the run that it is inside of


def of_workflow(output: Path) -> tuple[Tracking, dict[str, str], str]:
    """Return where the workflow wants a folder's job recorded, the values of its variant, and its command."""
    uri, experiment = os.environ.get("TEXGS_TRACKING"), os.environ.get("TEXGS_EXPERIMENT", "texgs")
    own: dict[str, Any] = {}
    with suppress(KeyError, OSError, ValueError):  # of a job that no run of the workflow has started
        own = json.loads(Path(os.environ[RUNS]).read_text())[output.as_posix()]
    return Tracking(uri, experiment, own.get("parent")), own.get("swept", {}), own.get("command", "")


def name(job: Job) -> str:
    """Return the name of a job's run: data set, basic TF, recipe with variant and seeds, edit and stage.

    Jobs before a fit, which know of no variant, have the values that tell theirs from others.
    """
    settings, swept = job.settings, [f"{key}={value}" for key, value in job.swept.items()]
    own = facts(settings)
    fit = label(own)
    words = (settings["dataset"], settings.get("tf"), fit, own.get("edit"), settings["stage"])
    return " ".join(filter(None, [*words, *([] if fit else swept)]))


def tags(job: Job, identity: Mapping[str, Any], parent: str | None) -> dict[str, str]:
    """Return what runs are found and compared by."""
    own = {**facts(job.settings), "device": job.settings.get("fit", {}).get("device")}
    return {
        "mlflow.user": user(),
        **({PARENT: parent} if parent else {}),
        **{key: str(value) for key, value in own.items() if value not in (None, "", NO_SWEEP)},
        "config.sha": identity["settings"],
        "code.sha": identity["code"],
        "git.sha": git_revision(),
        OUTPUT: job.output.absolute().as_posix(),
    }


def params(job: Job) -> dict[str, str]:
    """Return the settings of a job as text, by their whole keys, and the values that its sweep gives it."""
    return flatten({**job.swept, **job.settings})


def flatten(values: Mapping[str, object], prefix: str = "") -> dict[str, str]:
    """Return parameters of a nested mapping: keys joined by dots, lists and such as JSON."""
    flat: dict[str, str] = {}
    for key, value in values.items():
        if isinstance(value, Mapping) and value:
            flat |= flatten(value, f"{prefix}{key}.")
        else:
            is_plain = not (value is None or isinstance(value, bool | list | tuple | Mapping))
            flat[f"{prefix}{key}"] = str(value) if is_plain else json.dumps(value, default=str)
    return flat


def log_result(run: Run, job: Job, metrics: Mapping[str, Any]) -> None:
    """Record the numbers, curves and pictures of a job, and the path and checksum of what others read."""
    run.log({name: metrics[name] for name in ("seconds", "peak_memory_mib")} | scalars(metrics["numbers"]))
    for step, values in curves(metrics["numbers"]):
        run.log(values, step)
    checksums = result.file_checksums(job.output)
    for file in job.stage.rule.files[:1]:
        run.tag({"file": (job.output / file).as_posix(), "file.sha256": checksums[file]})
    for picture in (*metrics["pictures"], result.METRICS):
        run.artifact(job.output / picture)


def curves(numbers: Mapping[str, Any]) -> Iterator[tuple[int, dict[str, float]]]:
    """Yield steps and values of what has several: times of frames, and losses of edits over iterations.

    Losses of fits are told while they run.
    """
    for key, listed in numbers.items():
        if isinstance(listed, list) and key.endswith("_ms"):
            yield from ((step, {key: float(value)}) for step, value in enumerate(listed))
    losses = numbers.get("losses")
    for name, listed in losses.items() if isinstance(losses, dict) else ():
        total = numbers.get("iterations") or len(listed)
        for index, loss in enumerate(listed, 1):
            yield round(total * index / len(listed)), {f"loss/{name}": float(loss)}


def scalars(numbers: Mapping[str, Any]) -> dict[str, float]:
    """Return the entries that are single numbers, also those of tables and of rows with titles in them."""
    single: dict[str, float] = {}
    for key, value in numbers.items():
        if isinstance(value, int | float):
            single[key] = float(value)
        elif isinstance(value, dict) and key != "notes":
            single |= scalars(value)
        elif isinstance(value, list) and value and all(isinstance(row, dict) for row in value):
            single |= rows(key, value)
    return single


def rows(key: str, listed: list[dict[str, Any]]) -> dict[str, float]:
    """Return the numbers of rows with names, such as `pse_psnr/other colours`, and the mean of each column.

    All texts of a row together are its name.
    """
    single: dict[str, float] = {}
    for column in dict.fromkeys(name for row in listed for name in row):
        values = {
            "/".join(text for text in row.values() if isinstance(text, str)): float(row[column])
            for row in listed
            if isinstance(row.get(column), int | float)
        }
        single |= {f"{key}_{column}/{name}": value for name, value in values.items()}
        if values:
            single[f"{key}_{column}"] = fmean(values.values())
    return single


def runs_file(results: str) -> str:
    """Return the file that tells jobs which run they are inside of, their swept values and commands."""
    return f"{results}/.conf/runs.json"


def begin_runs(plan: Plan, words: tuple[str, ...]) -> dict[str, Run]:
    """Begin the runs of a workflow and of its sweeps, by name, and write the file that jobs read.

    The same command in the same place goes on with the runs that it had.
    """
    place = Path(plan.results).absolute().as_posix()
    key = digest("\n".join([place, *words]))
    common = {"mlflow.user": user(), "git.sha": git_revision()}

    def run(name: str, title: str, tags: Mapping[str, str], params: Mapping[str, str]) -> Run:
        given: dict[str, Any] = {"name": title, "tags": {**common, **tags}, "params": params}
        return begin(plan.tracking, experiment=plan.experiment, key=f"{key} {name}", **given)

    values = {word.partition("=")[0].lstrip("+"): word.partition("=")[2] for word in words}
    groups = " ".join(word for word in words if "." not in word.partition("=")[0])
    runs = {WHOLE: run(WHOLE, groups or "texgs", {"stage": "workflow", OUTPUT: place}, values)}
    for name in filter(None, plan.sweeps):
        keys = {key for folder in plan.sweeps[name] for key in plan.jobs[folder]["swept"]}
        tags = {"stage": "sweep", "sweep": name}
        runs[name] = run(name, f"sweep {name}", tags, {"keys": ", ".join(sorted(keys))})
        runs[name].end("FINISHED")  # it only holds those of its jobs
    known = {
        folder: {"parent": runs[owner(plan, folder)].id, "swept": job["swept"], "command": job["command"]}
        for folder, job in plan.jobs.items()
    }
    write_json(runs_file(plan.results), known)
    return runs


def end_runs(runs: Mapping[str, Run], status: str, plan: Plan, made: Iterable[str]) -> None:
    """End the run of a workflow; it and its sweeps get the tables and the report that it has made."""
    files = [Path(file) for file in sorted(made) if Path(file).is_file()]
    tables, report = Path(plan.results, "tables"), Path(plan.results, "report.html")
    for name, run in runs.items():
        for file in files:
            if file.parent == tables and (name == WHOLE or file.stem == f"sweep-{name}"):
                run.artifact(file, tables.name)
            elif file == report and name == WHOLE:
                run.artifact(file)
    if runs:
        runs[WHOLE].end(status)


def owner(plan: Plan, folder: str) -> str:
    """Return the sweep that a job is of; that of the whole where it is of several, or of none."""
    names = [name for name, folders in plan.sweeps.items() if folder in folders]
    return names[0] if len(names) == 1 else WHOLE
