"""The plan of a run: its jobs with their settings, code and files, in plain values that a file can hold.

Snakemake reads the Snakefile again in each job on a cluster. There the plan comes from the file that the run
wrote before it submitted the job, so that nothing is composed, digested or looked up again.
"""

import json
import os
import shlex
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from texgs.config.project import ROOT, folders
from texgs.config.schema import Config
from texgs.core.cache import Checksums, checksum_of_folders, digest, keep, recall
from texgs.core.errors import ConfigError
from texgs.core.io import read_json, write_bytes
from texgs.volume.settings import cached_volume
from texgs.workflow.cases import LeftOut
from texgs.workflow.graph import earlier_results, graph_of
from texgs.workflow.job import Job, settings_file
from texgs.workflow.notes import note_results, note_tables
from texgs.workflow.stage import Rule, edit_folder, fit_folder
from texgs.workflow.stage_table import RULES, STAGES
from texgs.workflow.sweep import as_sweep

GROUPS = ("experiment", "dataset", "views", "fit", "edit", "sweep", "device", "tracking")


@dataclass(frozen=True)
class Plan:
    """What the rules read."""

    results: str
    tracking: str | None  # URI of the store
    experiment: str  # of MLflow
    gpu: list[str]  # what GPUs are for: "views", "fit" or both
    jobs: dict[str, dict[str, Any]]  # by folder, see `plain`; a run goes through those that its targets need
    sweeps: dict[str, list[str]]  # folders of the jobs of each sweep, "" for those of none
    downloads: dict[str, tuple[str, str]]  # address and checksum of volumes, by the files they go to
    wildcards: dict[str, list[str]]  # values of those in folders of rules, such as `dataset`
    left_out: str  # file that tells what the run goes on without
    earlier: dict[str, str]  # metrics files of other runs with the same results, and their digests
    replaced: list[str]  # folders with results of other settings, in whose place the run puts its own
    notes: dict[str, str]  # files that tables and the report read: whether somebody else has changed them

    def warnings(self) -> list[str]:
        """Return what a user should know before the run begins, a sentence each."""
        sentences = []
        if left_out := read_json(Path(self.left_out)):
            first, others = left_out[0], len(left_out) - 1
            end = f" (and {others} more: the report and texgs doctor list them)" if others else ""
            sentences.append(f"left out or replaced: {first['what']}: {first['why']}{end}")
        if self.replaced:
            others = len(self.replaced) - 1
            verb = f"and {others} more hold" if others else "holds"
            sentences.append(
                f"{self.replaced[0]} {verb} results of other settings, which this run replaces; "
                "results=FOLDER keeps both"
            )
        return sentences

    def target(self, name: str) -> list[str]:
        """Return the metrics files of all jobs of a target; of galleries also those of sweeps."""
        places = [rule.name for rule in RULES.values() if rule.target == name]
        sweeps = self.sweeps if "gallery" in places else [""]
        return [file for sweep in sweeps for file in self.metrics_of(*places, sweep=sweep)]

    def swept(self) -> list[str]:
        """Return the sweeps that have fits, by name."""
        return sorted(name for name in self.sweeps if name and self.metrics_of("phase", sweep=name))

    def metrics_shown(self, *places: str) -> list[str]:
        """Return the metrics files that tables read, of some places, and all that is shown of sweeps."""
        swept = [rule.name for rule in RULES.values() if rule.swept]
        of_sweeps = [file for name in self.swept() for file in self.metrics_of(*swept, sweep=name)]
        return sorted({*self.metrics_of(*places), *of_sweeps})

    def gpus(self, rule: Rule) -> int:
        """Return how many GPUs a job of a rule takes."""
        return int(any(use in self.gpu for use in rule.gpu))

    def metrics_of(self, *places: str, sweep: str = "") -> list[str]:
        """Return the metrics files of all jobs that have one of some places, of a sweep or of none."""
        folders = self.sweeps.get(sweep, ())
        return sorted(f"{folder}/metrics.json" for folder in folders if self.jobs[folder]["place"] in places)


def words_of(config: Mapping[str, Any]) -> tuple[str, ...]:
    """Return what Snakemake's `--config` says, in Hydra's syntax; keys with several values are a sweep."""
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
    """Return the plan of a run, and a sentence for each thing that is missing for some of its jobs.

    A job on a cluster has that of the run that submitted it.
    """
    path = Path(".snakemake", "texgs", f"plan-{digest(repr(words))}.json")
    data = os.environ.get("TEXGS_DATA", "")
    key = digest("\n".join([*words, data, checksum_of_folders(ROOT / "texgs", *folders())]))
    if is_job and (kept := recall(path, key)):
        with suppress(TypeError):  # of a damaged file, it is made again
            return Plan(**kept), []
    plan, missing = make(words)
    keep(path, key, asdict(plan))
    return plan, missing


def make(words: tuple[str, ...]) -> tuple[Plan, list[str]]:
    """Plan a run, and note in their settings which results are not those of the plan; see `planned`."""
    checksums = Checksums.load()
    cases, graph = graph_of(words, checksums)
    config, configs = cases.config, cases.configs
    results = Path(config.results).as_posix()  # as the folders of the jobs have it
    if results == ".":
        raise ConfigError("results: expected a folder of its own, got the current one; choose another")
    others, outdated = earlier_results(results, graph, checksums)
    jobs = {folder: plain_job(job, results) for folder, job in graph.jobs.items()}
    note_results(graph.jobs.values(), [job["settings"] for job in jobs.values()])
    uses = {"views" for each in configs if each.views.renderer == "gpu"}
    uses |= {"fit" for each in configs if each.device.name == "cuda"}
    plan = Plan(
        results,
        config.tracking.uri,
        config.tracking.experiment,
        sorted(uses),
        jobs,
        graph.sweeps,
        downloads(configs),
        wildcards(configs),
        left_out({**cases.left_out, **outdated}, results),
        others,
        graph.of_other_settings,
        note_tables(results, checksums),
    )
    checksums.save()
    return plan, list(graph.missing)


def plain_job(job: Job, results: str) -> dict[str, Any]:
    """Return a job in plain values; its settings file is written."""
    return {
        "stage": job.stage.name,
        "place": job.stage.place,
        "settings": settings_file(job.settings, results),
        "code": job.stage.code(job.settings),
        "inputs": {name: path.as_posix() for name, path in job.inputs.items()},
        "swept": dict(job.swept),
        "command": job.command,
    }


def wildcards(configs: Sequence[Config]) -> dict[str, list[str]]:
    """Return what the wildcards of rules stand for in these configurations."""
    values = {
        "dataset": {each.dataset.name for each in configs},
        "views": {each.views.name for each in configs},
        "fit": {fit_folder(each) for each in configs},
        "edit": {edit_folder(each) for each in configs},
        "gallery": {each.gallery.name for each in configs},
        "phase": {stage.name for stage in STAGES.values() if stage.place == "phase"},
    }
    return {name: sorted(own) for name, own in values.items()}


def left_out(entries: Mapping[LeftOut, Iterable[str]], results: str) -> str:
    """Write what a run goes on without, with the places of its jobs, as JSON; return the path of the file."""
    text = json.dumps([{**asdict(each), "places": [*places]} for each, places in entries.items()], indent=1)
    path = Path(results) / ".conf" / f"left-out-{digest(text)}.json"
    if not path.exists():
        write_bytes(path, text.encode())
    return path.as_posix()


def downloads(configs: Iterable[Config]) -> dict[str, tuple[str, str]]:
    """Return address and checksum of the volumes that are not in the data folder, by the files they go to."""
    volumes = [(config.data_folder, config.dataset.volume) for config in configs]
    absent = [each for folder, each in volumes if each.url and not Path(folder, each.file or "").exists()]
    return {cached_volume(each).as_posix(): (str(each.url), str(each.sha256)) for each in absent}
