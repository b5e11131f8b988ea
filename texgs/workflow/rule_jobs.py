"""What the rules of Snakemake ask of a plan: inputs, command and code of the job of some wildcards."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from texgs.workflow.plan import Plan
from texgs.workflow.stage import Rule

Wildcards = Mapping[str, str]


class RuleJobs:
    """The jobs of a plan, each found by the wildcards of its rule; the methods return functions of these."""

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
