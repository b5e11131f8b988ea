"""Snakemake as texgs runs it: its options and profiles, its errors, and what a run holds while its jobs run.

This file alone uses what Snakemake does not document: `snakemake.cli`, which reads options and profiles;
`SnakemakeApi.print_exception`, which would print a full disk with a traceback; and scheduler and DAG of the
`workflow` of a Snakefile. tests/test_private_names.py tells when a new version lacks one of these names.
"""

import argparse
import atexit
import os
import re
import shlex
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import yaml
from snakemake_interface_logger_plugins.registry import LoggerPluginRegistry

from texgs.cli import run_log
from texgs.cli.options import Parser
from texgs.core.errors import ArgumentError, TexgsError
from texgs.workflow import tracked
from texgs.workflow.notes import note_written
from texgs.workflow.plan import Plan
from texgs.workflow.result import run_alone
from texgs.workflow.stage_table import RULES

INTERRUPTED = ": interrupted; "  # of `texgs.cli.main`: the end of a run says so by itself


@contextmanager
def option_errors() -> Iterator[None]:
    """Raise an ArgumentError for options that Snakemake cannot read."""
    from snakemake.cli import CliException
    from snakemake.exceptions import WorkflowError

    try:
        yield
    except RuntimeError as error:  # it looks for its own configuration in the user's home
        raise ArgumentError(f"HOME: snakemake needs a home folder ({error}); set HOME to one") from error
    except (CliException, WorkflowError) as error:
        raise ArgumentError(f"{str(error).rstrip('. ')}; see snakemake --help") from error


def parser_of(profiles: Sequence[str] = ()) -> argparse.ArgumentParser:
    """Return the parser of Snakemake's options with defaults of some profiles, which tells one sentence."""
    from snakemake.cli import get_argument_parser

    parser: argparse.ArgumentParser = get_argument_parser(profiles=[*profiles] or None)
    parser.prog = "snakemake"
    of = " of SNAKEMAKE_PROFILE" if os.environ.get("SNAKEMAKE_PROFILE") in profiles else ""
    where = f"{' and '.join(profiles)}{of}: " if profiles else ""
    parser.error = partial(Parser.error, parser, where=where)  # type: ignore[arg-type, method-assign]
    return parser


def overrides(words: Sequence[str], config: Sequence[str]) -> list[str]:
    """Return the words as one entry of snakemake's `--config`, which reads values as YAML."""
    from snakemake.cli import parse_config

    try:
        parse_config(config)
    except ValueError as error:
        given = " ".join(config)
        raise ArgumentError(f"--config: expected KEY=VALUE, such as fit=quick, got {given}") from error
    if not words:
        return []
    if any(entry.startswith("overrides=") for entry in config):
        raise ArgumentError('--config overrides="...": give its words to texgs run itself')
    text = yaml.safe_dump(shlex.join(words), default_style='"', allow_unicode=True, width=10**9)
    return [f"overrides= {text.strip()} "]  # in spaces: snakemake strips quotes from the ends


def execute(options: argparse.Namespace, *, own_log: bool) -> bool:
    """Run Snakemake on all cores or as options say, with our log or its own; return whether all went well."""
    from snakemake.cli import args_to_api, parse_cores

    if own_log:
        LoggerPluginRegistry().register_plugin("texgs", run_log)
        options.logger = ["texgs"]
    if options.cores is None and options.jobs is None:
        options.cores = parse_cores("all")
    with place_errors():
        return bool(args_to_api(options, parser_of()))


@contextmanager
def place_errors() -> Iterator[None]:
    """Raise one sentence for a place that Snakemake cannot use, which it would print with a traceback."""
    from snakemake.api import SnakemakeApi

    printed = SnakemakeApi.print_exception

    def tell(api: SnakemakeApi, error: Exception) -> None:
        if isinstance(error, BrokenPipeError):  # by `| head`
            raise error
        if isinstance(error, OSError) and error.strerror:
            place = error.filename or f"{tempfile.gettempdir()}, the temporary folder"
            raise ArgumentError(
                f"{place}: the run cannot work there ({error.strerror}); make room, or choose another folder"
            ) from error
        printed(api, error)

    SnakemakeApi.print_exception = tell
    try:
        yield
    finally:
        SnakemakeApi.print_exception = printed


class WorkflowRun:
    """What a run holds while its jobs run: the lock of its results, a server and the tracked runs.

    `start_server` starts what forks the jobs, where there are several on this machine.
    """

    def __init__(
        self, workflow: Any, plan: Plan, words: tuple[str, ...], start_server: Callable[[], object]
    ) -> None:
        self._workflow, self._plan, self._words, self._start_server = workflow, plan, words, start_server
        self._tracked: dict[str, tracked.Run] = {}
        self.has_own_log = "texgs" in workflow.output_settings.log_handler_settings
        self._held: list[object] = []  # released at the end of this process, however it ends

    def begin(self) -> None:
        """Lock the results, begin the tracked runs and start what forks the jobs; end with 2 on an error."""
        try:
            self._held.append(run_alone(self._plan.results))
            jobs = [job for job in self._workflow.dag.needrun_jobs() if job.rule.name in RULES]
            if self._workflow.local_exec:
                # A limit of jobs a second makes Snakemake look at all jobs once more after each look, so that
                # a long run does so all the time: github.com/snakemake/snakemake/issues/2967.
                self._workflow.scheduler.job_rate_limiter = None
            if self._workflow.local_exec and len(jobs) > 1:
                self._held.append(self._start_server())
            self._tracked = tracked.begin_runs(self._plan, self._words)
        except TexgsError as error:
            print(f"texgs: {error}", file=sys.stderr)
            sys.exit(2)

    def succeed(self) -> None:
        """End the tracked runs; print where the report is, and how to look at the scenes and the runs."""
        self._end_log()
        plan, made = self._plan, self._made()
        note_written(plan.results, made)
        tracked.end_runs(self._tracked, "FINISHED", plan, made)
        report = f"{plan.results}/report.html"
        print("Done:", report if report in made else "what was asked for")
        files = [file for file in plan.metrics_of("steps") or plan.metrics_of("compose") if file in made]
        if files:
            program = Path(sys.executable).with_name("texgs")
            scene = Path(files[0]).with_name("scene.yaml")
            print("View:", shlex.join([str(program), "view", str(scene)]))
        if (plan.tracking or "").startswith("sqlite"):
            interface = ("-m", "mlflow", "ui", "--backend-store-uri", str(plan.tracking))
            print("Runs:", shlex.join([sys.executable, *interface]))

    def fail(self) -> None:
        """End the tracked runs; print why jobs failed as the process ends, after all that Snakemake says."""
        tracked.end_runs(self._tracked, "FAILED", self._plan, self._made())
        logs = [Path(log).absolute() for job in self._workflow.scheduler.failed for log in job.log]
        if not self._end_log():  # ours has said why
            atexit.register(tell_last_words, logs)

    def _end_log(self) -> bool:
        """End our log, so that others print after it, but not Snakemake; return whether there is one."""
        if self.has_own_log:
            self._workflow.logger_manager.queue_listener.stop()
            self._workflow.logger_manager.get_log_handlers()[0].close()
        return self.has_own_log

    def _made(self) -> set[str]:
        return {str(file) for job in self._workflow.dag.jobs for file in job.output}


def tell_last_words(logs: Iterable[Path]) -> None:
    """Print the last line of each log on stderr, but of jobs that were interrupted; the same one once."""
    for line in dict.fromkeys(filter(None, map(last_line, logs))):
        print(line, file=sys.stderr)


def last_line(log: Path) -> str:
    """Return the last line of a log, with its place in the code if it has one; "" of an interrupted job."""
    text = log.read_text(encoding="utf-8", errors="replace") if log.is_file() else ""
    before, _, line = text.rstrip().rpartition("\n")
    places = re.findall(r'^  File "(.+)", line (\d+)', before.rpartition("Traceback")[2], re.MULTILINE)
    at = f"{places[-1][0]}, line {places[-1][1]}: " if places and not line.startswith("texgs ") else ""
    return "" if INTERRUPTED in line else f"{at}{line}"
