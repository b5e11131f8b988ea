"""What is not on this machine of what a run needs: data and weights."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from texgs.core.checksum import digest
from texgs.core.errors import MissingDataError
from texgs.core.io import write_atomic

if TYPE_CHECKING:
    from texgs.config.schema import Config
    from texgs.workflow.experiments import LeftOut


def lacking(config: Config) -> list[str]:
    """What is not on this machine of what a configuration needs, data and weights, a sentence for each."""
    from texgs.workflow import stage_table as stages
    from texgs.workflow.weights import missing  # not at the top: most runs have no need of it

    sentences = []
    try:
        for stage, each in stages.jobs(config):
            try:
                stage.inputs(each)
            except MissingDataError as error:
                sentences.append(str(error))
    except MissingDataError as error:  # the basic TFs themselves
        sentences.append(str(error))
    return list(dict.fromkeys([*sentences, *missing(config)]))


def left_out(entries: Mapping[LeftOut, Iterable[str]], results: str) -> str:
    """Write what a run goes on without, with the places of its jobs, to a file named after its contents.

    Returns:
        The path of the file: JSON, a list of objects with `what`, `why` and `places`.
    """
    listed = [{**asdict(each), "places": [*places]} for each, places in entries.items()]
    text = json.dumps(listed, indent=1)
    path = Path(results) / ".conf" / f"left-out-{digest(text)}.json"
    if not path.exists():
        write_atomic(path, lambda file: file.write(text.encode()))
    return path.as_posix()


def missing_weights(configs: Iterable[Config]) -> list[str]:
    """What edits need and this machine has not; mistakes in edits are told first."""
    from texgs.edit.method import NO_METHOD

    edited = [config for config in configs if config.edit.method != NO_METHOD]
    if not edited:
        return []
    from texgs.workflow.checks import check_edit  # not at the top: most runs have no edits
    from texgs.workflow.weights import missing

    for config in edited:
        check_edit(config)
    return list(dict.fromkeys(line for config in edited for line in missing(config)))
