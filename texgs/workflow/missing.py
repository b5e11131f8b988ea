"""What a run needs and this machine may not have: data, and weights, which are part of a job's identity."""

from collections.abc import Mapping

from texgs.config.schema import Config
from texgs.core.cache import Checksums
from texgs.core.errors import MissingDataError
from texgs.edit.keys import EditKeys
from texgs.edit.method import NO_METHOD, method_of
from texgs.models import weights
from texgs.workflow.stage import Stage
from texgs.workflow.stage_table import jobs

CHECKSUM_DIGITS = 12  # digits of checksums in settings


def lacking(config: Config) -> list[str]:
    """Return a sentence for each thing that a configuration needs, data and weights, and that is not here."""
    sentences = []
    try:
        for stage, each in jobs(config):
            try:
                stage.inputs(each)
            except MissingDataError as error:
                sentences.append(str(error))
    except MissingDataError as error:  # the basic TFs themselves
        sentences.append(str(error))
    return list(dict.fromkeys([*sentences, *missing_weights(config)]))


def missing_weights(config: Config) -> list[str]:
    """Return what is said of weights that an edit needs and cannot work with; nothing is downloaded."""
    return [
        f"edit {config.edit.name}: {why}" + (f", and {word} does without them" if word else "")
        for name, word in weights_needed(config.edit).items()
        if (why := weights.missing_advice(name))
    ]


def weights_needed(edit: EditKeys) -> Mapping[str, str]:
    """Return names of the weights that an edit needs, each with the word that does without."""
    if edit.method == NO_METHOD:
        return {}
    method = method_of(edit)
    words = method.of(edit).weights()
    return {name: word and f"edit.{method.name}.{word}" for name, word in words.items()}


def weights_of(stage: Stage, config: Config, checksums: Checksums) -> dict[str, str | None] | None:
    """Return checksums of all weights that a stage may work with, None for those that it cannot.

    They are part of a job's settings: when weights arrive or change, what used them is made again. A stage
    that never works with weights has None.
    """
    if stage.name == "edit_metrics":
        names = ["vgg16", "lpips_vgg", config.metric.clip]
    elif stage.place == "edit":
        names = list(weights_needed(config.edit))
    else:
        return None
    return {name: _short(name, checksums) for name in names}


def _short(name: str, checksums: Checksums) -> str | None:
    digest = weights.checksum(name, checksums)
    return digest and digest[:CHECKSUM_DIGITS]


def require_same(recorded: Mapping[str, str | None]) -> None:
    """Require that the weights on this machine are those of a job's settings."""
    checksums = Checksums.load()
    for name, expected in recorded.items():
        if (present := _short(name, checksums)) != expected:
            raise MissingDataError(
                f"weights of {name}: expected {expected or 'none'}, as when the job was planned, "
                f"got {present or 'none'}; run the same command again"
            )
