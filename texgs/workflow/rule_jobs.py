"""What the rules of Snakemake ask of a plan: inputs, command and code of the job of some wildcards."""

import shlex
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from texgs.core.memory import waiting
from texgs.workflow import tracked
from texgs.workflow.plan import Plan
from texgs.workflow.stage import Rule

Wildcards = Mapping[str, str]


class RuleJobs:
    """The jobs of a plan, each found by the wildcards of its rule. Methods return functions of wildcards."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan

    def of(self, rule: Rule, wildcards: Wildcards) -> tuple[str, dict[str, Any]]:
        """Return the folder of the job that wildcards describe, and what the plan says of it."""
        folder = Path(self._plan.results, rule.folder.format(**dict(wildcards.items()))).as_posix()
        return folder, self._plan.jobs[folder]

    def reads(self, rule: Rule) -> Callable[[Wildcards], list[str]]:
        """Return the files that a job reads, first its settings."""

        def files(wildcards: Wildcards) -> list[str]:
            _, job = self.of(rule, wildcards)
            return [job["settings"], *job["inputs"].values()]

        return files

    def words(self, rule: Rule) -> Callable[[Wildcards], list[str]]:
        """Return the words of a job's command behind `texgs`, first its stage."""

        def words(wildcards: Wildcards) -> list[str]:
            folder, job = self.of(rule, wildcards)
            inputs = [f"{name}={path}" for name, path in job["inputs"].items()]
            files = ["--input", *inputs] if inputs else []
            return [job["stage"], "--settings", job["settings"], *files, "--output", folder]

        return words

    def code(self, rule: Rule) -> Callable[[Wildcards], str]:
        """Return the digest of the code that a job runs."""
        return lambda wildcards: str(self.of(rule, wildcards)[1]["code"])


def report_params(plan: Plan) -> dict[str, Any]:
    """Return parameters of the rules of tables and the report: what they show beside the jobs of a run."""
    study = Path(plan.results, "study")  # its ballots never change, and more of them make another table
    ballots = sorted(map(str, study.glob("votes/*.csv")))
    return {
        "earlier": list(plan.earlier),
        "of_earlier": list(plan.earlier.values()),
        "left_out": plan.left_out,
        "ballots": ballots,
        "study": ["--study", f"{study}/key.json"] if ballots else [],
    }


def environment_of(plan: Plan) -> dict[str, str]:
    """Return environment variables of all jobs: what is recorded of them and where, and how threads wait."""
    own = waiting() | {tracked.RUNS: tracked.runs_file(plan.results)}
    if plan.tracking is not None:
        own |= {"TEXGS_TRACKING": plan.tracking, "TEXGS_EXPERIMENT": plan.experiment}
    return own


def shell_prefix(environment: Mapping[str, str], client: str, *, is_shown: bool) -> str:
    """Return what stands in front of the commands of all rules: `texgs`, by a client of the fork server.

    What jobs print goes to their logs, and where `is_shown` to the output of the run, too.
    A job goes on where nobody reads its output any more, and so does its log: `tee` would end with a signal,
    or where it is BSD's, at its end with an error.
    """
    setting = " ".join(f"{name}={shlex.quote(value)}" for name, value in environment.items())
    program = f"{setting} {shlex.quote(sys.executable)} -PSE {shlex.quote(client)}"
    tee = f'command tee "$@"{"" if is_shown else " > /dev/null"} || true'
    return f"set -euo pipefail; trap '' PIPE; tee() {{{{ {tee}; }}}}; texgs() {{{{ {program} \"$@\"; }}}}; "
