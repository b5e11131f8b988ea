"""Weights that edits need: whether they are on this machine, and their part in the identity of a job."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from texgs.core.checksum import Checksums
from texgs.core.errors import MissingDataError
from texgs.edit.method import NO_METHOD, method_of

if TYPE_CHECKING:
    from texgs.config.schema import Config
    from texgs.workflow.stage import Stage

SHOWN = 12  # digits of checksums in settings


def needed(config: Config) -> Mapping[str, str]:
    """Names of the weights that the edit of a configuration needs, each with the word that does without."""
    if config.edit.method == NO_METHOD:
        return {}
    method = method_of(config.edit)
    words = method.weights(method.of(config.edit))
    return {name: word and f"edit.{method.name}.{word}" for name, word in words.items()}


def weights_of(stage: Stage, config: Config, checksums: Checksums) -> dict[str, str | None] | None:
    """Checksums of all weights that a stage may work with, None for those that are not on this machine.

    They are part of a job's settings: when weights arrive or change, what used them is made again.

    Args:
        stage: of the job.
        config: of one edit, or of none.
        checksums: what is known of files.

    Returns:
        None for a stage that never works with weights.
    """
    if stage.name == "edit_metrics":
        names = ["vgg16", "lpips_vgg", config.metric.clip]
    elif stage.place == "edit":
        names = list(needed(config))
    else:
        return None
    return {name: _short(name, checksums) for name in names}


def _short(name: str, checksums: Checksums) -> str | None:
    from texgs.models.weights import checksum

    digest = checksum(name, checksums)
    return digest and digest[:SHOWN]


def require_same(recorded: Mapping[str, str | None]) -> None:
    """Require that the weights on this machine are those of a job's settings."""
    checksums = Checksums.load()
    for name, expected in recorded.items():
        if (present := _short(name, checksums)) != expected:
            raise MissingDataError(
                f"weights of {name}: expected {expected or 'none'}, as when the job was planned, "
                f"got {present or 'none'}; run the same command again"
            )


def missing(config: Config) -> list[str]:
    """What is said of weights that an edit needs and this machine has not; nothing is downloaded."""
    from texgs.models.weights import available

    return [
        f"edit {config.edit.name}: the weights of {name} are not on this machine; "
        f"`texgs weights {name}` downloads them or says how to get them"
        + (f", and {word} does without them" if word else "")
        for name, word in needed(config).items()
        if not available(name)
    ]
