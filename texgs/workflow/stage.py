"""What a stage of the workflow is: the configuration it reads, the code it runs, the place of its files.

A job's settings are written once to a file named after their contents. That file is an input of the job and
the digest of the code a parameter, so a changed value or line of code reruns what depends on it.
"""

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, cast

from omegaconf import DictConfig, OmegaConf

from texgs.config.compose import changed
from texgs.core.checksum import digest
from texgs.core.io import write_atomic
from texgs.edit.method import methods
from texgs.fields.kinds import kinds
from texgs.workflow.code import code_digest
from texgs.workflow.places import PLACES, folder_of

LONG_AGO = 946684800  # the year 2000, in seconds


@dataclass(frozen=True)
class Stage:
    """One arrow of the data flow: a verb of the command line, and a job of the workflow."""

    name: str
    module: str  # what the job runs
    select: Callable[[DictConfig], dict[str, Any]]  # the part of the configuration that the job reads
    inputs: Callable[[DictConfig], dict[str, Path]]  # the files it reads
    place: str  # of its files, a key of PLACES, and its rule in the workflow
    needs: tuple[str, ...] = ()  # stages that make these files
    applies: Callable[[DictConfig], bool] = lambda config: True  # whether a data set or edit goes through it
    fits: str = ""  # module of the kind of field that it fits

    @property
    def per_tf(self) -> bool:
        """Whether there is a job for each basic TF, not for the whole data set."""
        return PLACES[self.place].is_per_tf

    def settings(self, config: DictConfig) -> dict[str, Any]:
        """What a job reads, as plain lists and dicts.

        Raises:
            ConfigError: if the stage works on one basic TF, and `config.tf` is none of the data set's.
        """
        of_all = {"dataset": config.dataset.name, "stand_in": config.dataset.stand_in}
        selected = {"stage": self.name, **of_all, **self.select(config)}
        if self.per_tf:
            selected["tf"] = config.tf
        return cast(dict[str, Any], plain(selected))

    def output(self, config: DictConfig) -> Path:
        """Folder of the job's files."""
        return folder_of(self.place, config, phase=self.name)

    def code(self, settings: Mapping[str, Any]) -> str:
        """Digest of the code that a job runs: that of its stage, its kind of field and its method of editing.

        The last two are imported by the names in its settings, so the sources of the stage do not tell.
        """
        modules = [self.module, self.fits] if self.fits else [self.module]
        if self.place != "phase" and "fit" in settings:
            modules.append(kinds()[settings["fit"]["field"]].module)
        if "edit" in settings:
            modules.append(methods()[settings["edit"]["method"]].module)
        return digest(" ".join(map(code_digest, modules)))


def settings_file(settings: dict[str, Any], results: str) -> str:
    """Write a job's settings to `RESULTS/.conf/STAGE-DIGEST.yaml`, unless that is there; return its path."""
    text = _yaml(settings)
    path = Path(results) / ".conf" / f"{settings['stage']}-{digest(text)}.yaml"
    if not path.exists():
        write_atomic(path, lambda file: file.write(text.encode()))
    return path.as_posix()


def note_result(settings: str, note: str | None) -> None:
    """Write a note on the result of a job, with the time, under its settings, in place of the one before.

    Without a note the file is made older than any result: the job that read it with one needs no second run.
    """
    path = Path(settings)
    text = path.read_text(encoding="utf-8")
    kept = "".join(line for line in text.splitlines(keepends=True) if not line.startswith("#"))
    if note is not None:
        kept += f"# {datetime.now().isoformat(timespec='microseconds')} {note}\n"
    if kept != text:
        write_atomic(path, lambda file: file.write(kept.encode()))
        if note is None:
            os.utime(path, (LONG_AGO, LONG_AGO))


def settings_digest(settings: dict[str, Any]) -> str:
    """Digest of a job's settings: the one in the name of its file."""
    return digest(_yaml(settings))


def plain(value: Any) -> Any:
    """A value of a configuration, or tables and lists of them, as plain dicts and lists."""
    if OmegaConf.is_config(value):
        return OmegaConf.to_container(value, resolve=True)
    if isinstance(value, Mapping):
        return {str(name): plain(each) for name, each in value.items()}
    return [plain(each) for each in value] if isinstance(value, list | tuple) else value


def _yaml(settings: dict[str, Any]) -> str:
    return OmegaConf.to_yaml(OmegaConf.create(settings), sort_keys=True)


def for_tf(config: DictConfig, name: str) -> DictConfig:
    """The same configuration for one basic TF."""
    return changed(config, tf=name)
