"""The jobs of a run by their folders: what it goes through, what it replaces, and what it lacks."""

from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from os.path import normpath
from pathlib import Path
from typing import Any

from texgs.config.case import Case
from texgs.config.project import Words
from texgs.config.schema import Config
from texgs.core.cache import Checksums
from texgs.core.errors import ConfigError, MissingDataError
from texgs.core.io import read_json
from texgs.core.names import METRICS
from texgs.report import metrics_files
from texgs.report.metrics_files import Record, below, read_known
from texgs.workflow.cases import Cases, LeftOut, cases_of
from texgs.workflow.checks import check_basic_tfs, check_edit, check_fit
from texgs.workflow.job import Job
from texgs.workflow.missing import lacking, missing_weights
from texgs.workflow.result import damaged_files, fingerprint, is_complete, stamp_of
from texgs.workflow.stage_table import STAGES
from texgs.workflow.stage_table import jobs as jobs_of


@dataclass
class Graph:
    """Jobs, each of which reads files of others or files from elsewhere."""

    jobs: dict[str, Job] = field(default_factory=dict)  # by folder
    sweeps: dict[str, list[str]] = field(default_factory=dict)  # folders by sweep, "" for those of none
    configs: dict[str, Config] = field(default_factory=dict)  # of the jobs
    missing: dict[str, list[str]] = field(default_factory=dict)  # folders of jobs by what they lack

    @cached_property
    def run(self) -> dict[str, Job]:
        """The jobs that a run goes through: of a sweep what is shown, and what that needs."""
        of_sweeps = [folder for sweep, listed in self.sweeps.items() if sweep for folder in listed]
        shown = [folder for folder in of_sweeps if self.jobs[folder].stage.rule.swept]
        waiting, folders = [*self.sweeps.get("", ()), *shown], set[str]()
        while waiting:
            folder = waiting.pop()
            if folder in self.jobs and folder not in folders:
                folders.add(folder)
                waiting += [path.parent.as_posix() for path in self.jobs[folder].inputs.values()]
        return {folder: job for folder, job in self.jobs.items() if folder in folders}

    @cached_property
    def of_other_settings(self) -> list[str]:
        """The folders that hold results of other settings, which the run will replace."""
        return sorted(folder for folder, job in self.run.items() if job.replaces_other())

    def is_replaced(self, folder: str) -> bool:
        """Return whether the run puts another result into a folder, or one that comes from such a result."""
        if folder not in self.run:
            return False
        if folder not in self._replaced:
            job = self.run[folder]
            self._replaced[folder] = (
                not all(path.exists() for path in job.inputs.values())
                or stamp_of(job.output) != job.identity()
                or any(self.is_replaced(path.parent.as_posix()) for path in job.inputs.values())
            )
        return self._replaced[folder]

    @cached_property
    def _replaced(self) -> dict[str, bool]:
        return {}

    def add(self, case: Case, checksums: Checksums) -> list[str]:
        """Add the jobs of a configuration, which is checked before, and return their folders."""
        config = case.config
        check_basic_tfs(config.dataset)
        check_fit(config)
        check_edit(config)
        self.missing |= {line: [] for line in missing_weights(config)}
        try:
            listed = jobs_of(config)
        except MissingDataError as error:
            self.missing.setdefault(str(error), [])
            return []
        folders = []
        for stage, each in listed:
            try:
                job = Job.of(stage, each, checksums, case.words)
            except MissingDataError as error:
                job = Job(stage, stage.settings(each), {}, stage.output(each))
                self.missing.setdefault(str(error), []).append(job.output.as_posix())
            folders.append(job.output.as_posix())
            known = self.jobs.setdefault(folders[-1], job)
            if known != job:
                differing = [key for key in job.settings if job.settings[key] != known.settings.get(key)]
                raise ConfigError(
                    f"{job.output}: two jobs go there, which differ in {', '.join(differing) or 'inputs'}; "
                    "give both the same, such as views=paper, or one another name, such as fit.name=mine"
                )
            self.jobs[folders[-1]] = replace(known, swept=dict(known.swept.items() & job.swept.items()))
            self.configs.setdefault(folders[-1], each)
        return folders


def graph_of(words: Words, checksums: Checksums) -> tuple[Cases, Graph]:
    """Return the cases that a user's words come to, and their jobs."""
    cases, graph = cases_of(words, lacking), Graph()
    for sweep, listed in cases.by_sweep.items():
        folders = [folder for case in listed for folder in graph.add(case, checksums)]
        graph.sweeps[sweep] = list(dict.fromkeys(folders))
    return cases, graph


def earlier_results(
    results: str, of_run: Graph, checksums: Checksums
) -> tuple[dict[str, str], dict[LeftOut, list[str]]]:
    """Return the whole results of earlier runs, which tables and the report show beside those of a run.

    These are metrics files with digests of their contents, and with their places the results that come from
    others which have been replaced since, or will be by this run.
    """
    outdated: dict[LeftOut, list[str]] = {}
    whole: dict[str, dict[str, Any]] = {}  # facts by folder
    for folder in sorted({path.parent.as_posix() for path in below(results)} - set(of_run.run)):
        if is_complete(Path(folder), checksums):
            facts = read_json(Path(folder, METRICS))
            if facts["stage"] in STAGES:
                whole[folder] = facts
                continue
            why = f"is of the stage {facts['stage']}, which is not there any more; remove the folder"
            outdated[LeftOut(folder, why)] = []
        elif lost := damaged_files(Path(folder), checksums):
            outdated[LeftOut(folder, f"{lost[0]} is damaged or missing; run its job again")] = []

    @cache
    def replaced(folder: str) -> str:
        """Return the first of the folders that a result comes from, however far, that is another one now."""
        for name, path in whole[folder].get("made_from", {}).items():  # older versions of texgs do not tell
            source, was = Path(normpath(Path(folder, path))), whole[folder]["inputs"][name]
            parent = source.parent.as_posix()
            if not source.is_file():
                continue
            if fingerprint(source, checksums) != was or of_run.is_replaced(parent):
                return parent
            if parent in whole and (origin := replaced(parent)):
                return origin
        return ""

    for folder, facts in whole.items():
        if origin := replaced(folder):
            why = f"comes from {origin}, which has been made anew since; run its job again"
            outdated[LeftOut(folder, why)] = [STAGES[facts["stage"]].place]
    current = [Path(folder, METRICS) for folder in whole if not replaced(folder)]
    return {file.as_posix(): checksums.of(file) for file in current}, outdated


def current_records(results: str | Path) -> tuple[list[Record[Any]], list[metrics_files.LeftOut]]:
    """Read the whole results below a folder that come from what is there now, and what is left out."""
    files, outdated = earlier_results(str(results), Graph(), Checksums.load())
    records, old = read_known(files)
    left_out = [metrics_files.LeftOut(each.what, each.why, places) for each, places in outdated.items()]
    return records, [*left_out, *old]
