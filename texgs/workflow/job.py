"""A job: a stage with its settings, the files it reads and the folder of its result."""

import shlex
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import yaml

from texgs.config.project import Words
from texgs.config.schema import Config
from texgs.core.cache import Checksums, digest
from texgs.core.errors import ArgumentError
from texgs.core.io import read_json, write_bytes
from texgs.core.names import METRICS
from texgs.workflow import result
from texgs.workflow.missing import weights_of
from texgs.workflow.stage import Stage
from texgs.workflow.sweep import swept_values

LISTED_KEYS = 3  # of settings, in a message


@dataclass(frozen=True)
class Job:
    """A stage with everything it needs."""

    stage: Stage
    settings: dict[str, Any]
    inputs: Mapping[str, Path]
    output: Path
    checksums: Checksums = field(default_factory=Checksums, compare=False)  # what is known of files
    swept: Mapping[str, str] = field(default_factory=dict, compare=False)  # see workflow/sweep.py
    command: str = field(default="", compare=False)  # see `command`

    @classmethod
    def of(cls, stage: Stage, config: Config, checksums: Checksums, words: Words = ()) -> Self:
        """Return the job that a configuration describes; its settings name the weights that it works with.

        `words` are those that compose the configuration.
        """
        settings, weights = stage.settings(config), weights_of(stage, config, checksums)
        named = {} if weights is None else {"weights": weights}
        files, by_hand = (stage.inputs(config), stage.output(config)), command(stage, config, words)
        return cls(stage, {**settings, **named}, *files, checksums, swept_values(config), by_hand)

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
        known = result.stamp_of(self.output) or {}
        return (self.output / METRICS).exists() and known.get("settings") != settings_digest(self.settings)

    def require_same_settings(self, results: str) -> None:
        """Require that the job replaces no result of other settings, whatever weights that had."""
        if not self.replaces_other():
            return
        known = result.stamp_of(self.output) or {}
        there = read_settings(Path(results, ".conf", f"{known.get('stage')}-{known.get('settings')}.yaml"))
        keys = difference(there, self.settings)
        if there and not keys:
            return
        made_by = read_json(self.output / METRICS).get("command")
        raise ArgumentError(
            f"{self.output} holds a result of other settings{f' ({keys})' if there else ''}, which would be "
            "lost; results=FOLDER keeps both, --replace the new one alone"
            + (f"; what is there was made by: {made_by}" if made_by else "")
        )

    def is_done(self) -> bool:
        """Return whether the folder holds the whole result of exactly this job."""
        if not result.is_complete(self.output, self.checksums):
            return False
        return all(path.exists() for path in self.inputs.values()) and (
            result.stamp_of(self.output) == self.identity()
        )


def command(stage: Stage, config: Config, words: Words) -> str:
    """Return the command line that makes one job's result; the words compose its configuration."""
    last = {word.partition("=")[0]: word for word in words}
    tf = [] if config.tf is None or "tf" in last else [f"tf={config.tf}"]
    return shlex.join(["texgs", stage.name, *last.values(), *tf])


def settings_file(settings: dict[str, Any], results: str) -> str:
    """Write a job's settings to `RESULTS/.conf/STAGE-DIGEST.yaml`, unless that is there; return its path."""
    text = _yaml(settings)
    path = Path(results) / ".conf" / f"{settings['stage']}-{digest(text)}.yaml"
    if not path.exists():
        write_bytes(path, text.encode())
    return path.as_posix()


def read_settings(file: Path) -> dict[str, Any]:
    """Read the settings of a job; without a file, none."""
    return yaml.load(file.read_bytes(), yaml.CSafeLoader) if file.is_file() else {}


def difference(there: Mapping[str, Any], here: Mapping[str, Any]) -> str:
    """Return the keys, with both values, in which settings differ in more than the weights, in words."""
    old, new = dict(leaves(there)), dict(leaves(here))
    keys = [key for key in {**old, **new} if old.get(key) != new.get(key) and not key.startswith("weights.")]
    named = [f"{key} is {old.get(key)!s:.40}, not {new.get(key)!s:.40}" for key in keys[:LISTED_KEYS]]
    return "; ".join(named) + (f" and {len(keys) - LISTED_KEYS} more" if keys[LISTED_KEYS:] else "")


def leaves(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the values in nested tables by their dotted keys."""
    for key, value in table.items():
        if isinstance(value, Mapping) and value:
            yield from leaves(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def settings_digest(settings: dict[str, Any]) -> str:
    """Return the digest of a job's settings: the one in the name of its file."""
    return digest(_yaml(settings))


def _yaml(settings: dict[str, Any]) -> str:
    return yaml.dump(settings, Dumper=yaml.CSafeDumper, allow_unicode=True)
