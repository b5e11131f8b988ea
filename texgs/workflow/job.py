"""A job: a stage with its settings, the files it reads and the folder of its result."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import yaml

from texgs.config.schema import Config
from texgs.core.cache import Checksums, digest
from texgs.core.io import write_bytes
from texgs.core.names import METRICS
from texgs.workflow import result
from texgs.workflow.missing import weights_of
from texgs.workflow.stage import Stage
from texgs.workflow.sweep import swept


@dataclass(frozen=True)
class Job:
    """A stage with everything it needs."""

    stage: Stage
    settings: dict[str, Any]
    inputs: Mapping[str, Path]
    output: Path
    checksums: Checksums = field(default_factory=Checksums, compare=False)  # what is known of files
    swept: Mapping[str, str] = field(default_factory=dict, compare=False)  # see workflow/sweep.py

    @classmethod
    def of(cls, stage: Stage, config: Config, checksums: Checksums) -> Self:
        """Return the job that a configuration describes; its settings name the weights that it works with."""
        settings, weights = stage.settings(config), weights_of(stage, config, checksums)
        named = {} if weights is None else {"weights": weights}
        files = stage.inputs(config), stage.output(config)
        return cls(stage, {**settings, **named}, *files, checksums, swept(config))

    def identity(self) -> dict[str, Any]:
        """Return what the job's result depends on: settings, code and the contents of input files."""
        return {
            "stage": self.stage.name,
            "settings": settings_digest(self.settings),
            "code": self.stage.code(self.settings),
            "inputs": {name: result.fingerprint(path, self.checksums) for name, path in self.inputs.items()},
        }

    def replaces_other(self) -> bool:
        """Return whether the folder holds a result of other settings, which the job would replace."""
        known = result.stamped(self.output) or {}
        return (self.output / METRICS).exists() and known.get("settings") != settings_digest(self.settings)

    def is_done(self) -> bool:
        """Return whether the folder holds the whole result of exactly this job."""
        if not result.is_complete(self.output, self.checksums):
            return False
        return all(path.exists() for path in self.inputs.values()) and (
            result.stamped(self.output) == self.identity()
        )


def settings_file(settings: dict[str, Any], results: str) -> str:
    """Write a job's settings to `RESULTS/.conf/STAGE-DIGEST.yaml`, unless that is there; return its path."""
    text = _yaml(settings)
    path = Path(results) / ".conf" / f"{settings['stage']}-{digest(text)}.yaml"
    if not path.exists():
        write_bytes(path, text.encode())
    return path.as_posix()


def settings_digest(settings: dict[str, Any]) -> str:
    """Return the digest of a job's settings: the one in the name of its file."""
    return digest(_yaml(settings))


def _yaml(settings: dict[str, Any]) -> str:
    return yaml.dump(settings, Dumper=yaml.CSafeDumper, allow_unicode=True)
