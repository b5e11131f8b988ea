"""What the tracking store is told of a job: its name, tags, parameters, numbers and curves."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING, Any

from texgs.config.schema import NO_SWEEP
from texgs.report.metrics_files import label
from texgs.workflow import result
from texgs.workflow import tracking as track
from texgs.workflow.provenance import edit, git_revision, recipe, seed, user

if TYPE_CHECKING:
    from texgs.workflow.job import Job

RUNS = "TEXGS_RUNS"  # environment variable: the file that says which run each job is inside of


@dataclass(frozen=True)
class Tracking:
    """Where the run of a job is recorded."""

    uri: str | None  # of the store; None: nowhere
    experiment: str
    parent: str | None = None  # identifier of the run that it is inside of


def of_workflow(output: Path) -> tuple[Tracking, dict[str, str]]:
    """Where the workflow wants the job of a folder recorded, and what tells its variant from others."""
    uri, experiment = os.environ.get("TEXGS_TRACKING"), os.environ.get("TEXGS_EXPERIMENT", "texgs")
    runs: dict[str, Any]
    try:
        runs = json.loads(Path(os.environ[RUNS]).read_text()) if uri else {}
    except (KeyError, OSError, ValueError):  # a job that no run of the workflow has started
        runs = {}
    own = runs.get(output.as_posix(), {})
    return Tracking(uri, experiment, own.get("parent")), own.get("swept", {})


def name(job: Job) -> str:
    """Name of the run of a job: data set, basic TF, recipe with variant and seeds, edit and stage.

    Jobs before a fit, which know of no variant, have the values that tell theirs from others.
    """
    settings, swept = job.settings, [f"{key}={value}" for key, value in job.swept.items()]
    facts = {**recipe(settings), **edit(settings), "seed": seed(settings)}
    words = (settings["dataset"], settings.get("tf"), label(facts), facts.get("edit"), settings["stage"])
    return " ".join(filter(None, [*words, *([] if label(facts) else swept)]))


def tags(job: Job, identity: Mapping[str, Any], parent: str | None) -> dict[str, str]:
    """What runs are found and compared by."""
    facts: dict[str, Any] = {
        **{key: job.settings[key] for key in ("stage", "dataset", "tf") if key in job.settings},
        **recipe(job.settings),
        **edit(job.settings),
        "seed": seed(job.settings),
        "device": job.settings.get("fit", {}).get("device"),
    }
    return {
        "mlflow.user": user(),
        **({track.PARENT: parent} if parent else {}),
        **{key: str(value) for key, value in facts.items() if value not in (None, "", NO_SWEEP)},
        "config.sha": identity["settings"],
        "code.sha": identity["code"],
        "git.sha": git_revision(),
        "output": job.output.as_posix(),
        **track.process_tags(job.output / result.METRICS),
    }


def tell(run: track.Run, job: Job, metrics: Mapping[str, Any]) -> None:
    """Record the numbers, curves and pictures of a job, and the path and checksum of what others read."""
    run.log({name: metrics[name] for name in ("seconds", "peak_memory_mib")} | scalars(metrics["numbers"]))
    for step, values in curves(metrics["numbers"]):
        run.log(values, step)
    checksums = result.recorded(job.output)
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
    """The entries that are single numbers, also those of tables and of rows with titles in them."""
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
    """The numbers of rows with names, such as `pse_psnr/other colours`, and the mean of each column.

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
