"""The plan of a run: its jobs with their settings, code and files, in plain values that a file can hold.

Snakemake reads the Snakefile again in each job on a cluster. There the plan comes from the file that the run
wrote before it submitted the job, so that nothing is composed, digested or looked up again.
"""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texgs.config.project import folders
from texgs.core.cache import keep, recall
from texgs.core.checksum import digest, of_folders, sha256
from texgs.core.errors import ConfigError
from texgs.core.io import write_atomic
from texgs.workflow.code import ROOT
from texgs.workflow.stage import LONG_AGO
from texgs.workflow.stage_table import RULES, STAGES, SWEPT

if TYPE_CHECKING:
    from texgs.config.schema import Config
    from texgs.core.checksum import Checksums
    from texgs.workflow.job import Job
    from texgs.workflow.stage import Rule

GROUPS = ("experiment", "dataset", "views", "fit", "edit", "sweep", "device", "tracking")


@dataclass(frozen=True)
class Plan:
    """What the rules read."""

    results: str
    tracking: str | None  # URI of the store
    experiment: str  # of the store
    gpu: list[str]  # what GPUs are for: "views", "fit" or both
    jobs: dict[str, dict[str, Any]]  # stage, place, settings file, code, inputs and swept values, by folder
    sweeps: dict[str, list[str]]  # folders of the jobs of each sweep, "" for those of none
    downloads: dict[str, tuple[str, str]]  # address and checksum of volumes, by the files they go to
    wildcards: dict[str, list[str]]  # values of `dataset`, `views`, `fit`, `phase` and `edit`
    left_out: str  # file that tells what the run goes on without
    earlier: dict[str, str]  # metrics files of other runs with the same results, and their digests
    replaced: list[str]  # folders with results of other settings, in whose place the run puts its own
    notes: dict[str, str]  # files that tables and the report read: whether somebody else has changed them

    def warning(self) -> str:
        """What a user should know before the run begins; empty where there is nothing."""
        if not self.replaced:
            return ""
        others = len(self.replaced) - 1
        verb = f"and {others} more hold" if others else "holds"
        return (
            f"{self.replaced[0]} {verb} results of other settings, which this run replaces; "
            "results=FOLDER keeps both"
        )

    def target(self, name: str) -> list[str]:
        """Return the metrics files of all jobs of a target; of galleries also those of sweeps."""
        places = [rule.name for rule in RULES.values() if rule.target == name]
        sweeps = self.sweeps if "gallery" in places else [""]
        return [file for sweep in sweeps for file in self.done(*places, sweep=sweep)]

    def swept(self) -> list[str]:
        """Return the sweeps that have fits, by name."""
        return sorted(name for name in self.sweeps if name and self.done("phase", sweep=name))

    def told(self, *places: str) -> list[str]:
        """Return the metrics files that tables read, of some places, and all that is shown of sweeps."""
        of_sweeps = [file for name in self.swept() for file in self.done(*SWEPT, sweep=name)]
        return sorted({*self.done(*places), *of_sweeps})

    def gpus(self, rule: Rule) -> int:
        """Return how many GPUs a job of a rule takes."""
        return int(any(use in self.gpu for use in rule.gpu))

    def done(self, *places: str, sweep: str = "") -> list[str]:
        """The metrics files of all jobs that have one of some places, of a sweep or of none."""
        folders = self.sweeps.get(sweep, ())
        return sorted(f"{folder}/metrics.json" for folder in folders if self.jobs[folder]["place"] in places)


def words_of(config: Mapping[str, Any]) -> tuple[str, ...]:
    """What Snakemake's `--config` says, in Hydra's syntax; keys with several values are a sweep."""
    from texgs.workflow.product import as_sweep

    if unknown := sorted(set(config) - {*GROUPS, "overrides", "pathvars"}):
        expected = ", ".join(GROUPS)
        raise ConfigError(
            f'--config: expected {expected} or overrides="KEY=VALUE ...", got {", ".join(unknown)}'
        )
    lists = [group for group in GROUPS if not isinstance(config.get(group, ""), str)]
    if lists:
        raise ConfigError(
            f"{lists[0]}: expected one name, got {config[lists[0]]}; several data sets go to datasets=[...]"
        )
    groups = [f"{group}={config[group]}" for group in GROUPS if group in config]
    try:
        words = shlex.split(str(config.get("overrides", "")))
    except ValueError as error:
        raise ConfigError(f"overrides: {error}; put a word in quotes before the last one") from error
    return as_sweep((*groups, *words))


def planned(words: tuple[str, ...], *, is_job: bool) -> tuple[Plan, list[str]]:
    """The plan of a run, and a sentence for each thing that is missing for some of its jobs.

    Args:
        words: overrides of the configuration.
        is_job: whether this is a job of a run that has left its plan.
    """
    path = Path(".snakemake", "texgs", f"plan-{digest(repr(words))}.json")
    data = os.environ.get("TEXGS_DATA", "")
    key = digest("\n".join([*words, data, of_folders(ROOT / "texgs", *folders())]))
    if is_job and (kept := recall(path, key)):
        with suppress(TypeError):  # of a damaged file, it is made again
            return Plan(**kept), []
    plan, missing = make(words)
    keep(path, key, asdict(plan))
    return plan, missing


def make(words: tuple[str, ...]) -> tuple[Plan, list[str]]:
    """Plan a run, and note in their settings which results are not those of the plan; see `planned`."""
    from texgs.config.compose import compose
    from texgs.core.checksum import Checksums
    from texgs.workflow.absent import lacking, left_out, missing_weights
    from texgs.workflow.earlier import earlier
    from texgs.workflow.experiments import apart, selected
    from texgs.workflow.graph import graph

    checksums, selection = Checksums.load(), selected(words, lacking)
    configs = [each for some in selection.by_sweep.values() for each in some]
    config = compose(apart(words)[0])
    results = Path(config.results).as_posix()  # as the folders of the jobs have it
    planned = graph(selection.by_sweep, checksums)
    others, outdated = earlier(results, planned, checksums)
    plain_jobs = {folder: plain(job, results) for folder, job in planned.jobs.items()}
    note_results(planned.jobs.values(), [each["settings"] for each in plain_jobs.values()])
    plan = Plan(
        results,
        config.tracking.uri,
        config.tracking.experiment,
        gpu_uses(configs),
        plain_jobs,
        planned.sweeps,
        downloads(configs),
        wildcards(configs),
        left_out({**selection.left_out, **outdated}, results),
        others,
        planned.of_other_settings,
        notes(results, checksums),
    )
    checksums.save()
    return plan, list(dict.fromkeys([*planned.missing, *missing_weights(configs)]))


def gpu_uses(configs: Iterable[Config]) -> list[str]:
    """Return what GPUs are for in some configurations: views, fits or both."""
    uses = {"views" if each.views.mapper == "gpu" else "" for each in configs}
    uses |= {"fit" if each.device.name == "cuda" else "" for each in configs}
    return sorted(filter(None, uses))


def wildcards(configs: Sequence[Config]) -> dict[str, list[str]]:
    """What the wildcards of rules stand for in these configurations."""
    from texgs.workflow.stage import edit_folder, fit_folder

    values = {
        "dataset": {each.dataset.name for each in configs},
        "views": {each.views.name for each in configs},
        "fit": {fit_folder(each) for each in configs},
        "edit": {edit_folder(each) for each in configs},
        "gallery": {each.gallery.name for each in configs},
        "phase": {stage.name for stage in STAGES.values() if stage.place == "phase"},
    }
    return {name: sorted(own) for name, own in values.items()}


def plain(job: Job, results: str) -> dict[str, Any]:
    """A job in plain values; its settings file is written."""
    from texgs.workflow.stage import settings_file

    settings = settings_file(job.settings, results)
    inputs = {name: path.as_posix() for name, path in job.inputs.items()}
    return {
        "stage": job.stage.name,
        "place": job.stage.place,
        "settings": settings,
        "code": job.stage.code(job.settings),
        "inputs": inputs,
        "swept": dict(job.swept),
    }


def notes(results: str, checksums: Checksums) -> dict[str, str]:
    """Note in files for tables and the report what of them has been changed since they were made.

    Returns:
        These files by the names of the rules.
    """
    from texgs.workflow.stage import note_result

    made = recall(written_file(results), "") or {}
    changed = sorted(
        path for path, sha in made.items() if Path(path).exists() and checksums.of(Path(path)) != sha
    )
    files = {}
    for name, place in {"tables": f"{results}/tables", "report": f"{results}/report.html"}.items():
        files[name] = f"{results}/.conf/{name}.txt"
        if not Path(files[name]).exists():
            write_atomic(Path(files[name]), lambda file: file.write(b"whole\n"))
            os.utime(files[name], (LONG_AGO, LONG_AGO))
        own = [path for path in changed if path.startswith(place)]
        note_result(files[name], f"{', '.join(own)}: changed since they were made" if own else None)
    return files


def note_written(results: str, made: Iterable[str]) -> None:
    """Note the checksums of tables and the report, which a run has made, for the next one to compare."""
    known = recall(written_file(results), "") or {}
    of_tables = {path for path in made if path.startswith((f"{results}/tables/", f"{results}/report.html"))}
    keep(written_file(results), "", {**known, **{path: sha256(Path(path)) for path in sorted(of_tables)}})


def written_file(results: str) -> Path:
    """Return the file that holds the checksums of tables and the report."""
    return Path(results, ".conf", "written.json")


def note_results(jobs: Iterable[Job], settings: Iterable[str]) -> None:
    """Note in the settings files of jobs whether a result that is there is not theirs; several may share one.

    Snakemake knows of inputs and parameters. That a result is damaged, or that a job failed and left the
    result before it in place, it learns by this: it takes a file for changed where its contents are.
    """
    from texgs.workflow.result import METRICS
    from texgs.workflow.stage import note_result

    wrong: dict[str, list[str]] = {}
    for job, file in zip(jobs, settings, strict=True):
        if (job.output / METRICS).exists():
            wrong.setdefault(file, []).extend([] if job.is_done() else [str(job.output)])
    for file, outputs in wrong.items():
        note_result(file, f"{', '.join(outputs)}: not whole, or of another job" if outputs else None)


def downloads(configs: Iterable[Config]) -> dict[str, tuple[str, str]]:
    """Address and checksum of the volumes that are not in the data folder, by the files they go to."""
    from texgs.workflow.locate import cached_volume

    volumes = [(config.data_folder, config.dataset.volume) for config in configs]
    absent = [each for folder, each in volumes if each.url and not Path(folder, each.file or "").exists()]
    return {cached_volume(each).as_posix(): (str(each.url), str(each.sha256)) for each in absent}
