"""List pretrained weights with where they are, and download those that are named."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import TYPE_CHECKING

from texgs.core.checksum import Checksums
from texgs.core.errors import MissingDataError

if TYPE_CHECKING:
    from omegaconf import DictConfig

    from texgs.edit.recipe import Recipe

SHOWN = 12  # digits of checksums in settings


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which weights."""
    parser.add_argument(
        "names",
        nargs="*",
        metavar="NAME",
        help="weights to download, where they are not here (none: only list them)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Download what is named; then list all with their sizes and places."""
    from texgs.models.catalogue import CATALOGUE
    from texgs.models.weights import find, locate

    for name in arguments.names:
        locate(name)
    for name, entry in CATALOGUE.items():
        place = find(name) or f"not here; {entry.source}"
        print(f"{name:24} {entry.megabytes:6.0f} MB  {place}")
    return 0


def needed(config: DictConfig) -> list[str]:
    """Names of the weights that the edit of a configuration works with."""
    edit = config.edit
    if edit.kind == "image":
        recipe = _recipe(config)
        clicked = bool(edit.image.region) and edit.image.masks == "mobile_sam"
        asks_for_clip = recipe.needs_clip and edit.image.lambda_s is not None  # else it is left out
        own = {"vgg16": recipe.needs_vgg, config.metric.clip: asks_for_clip, "mobile_sam": clicked}
        return [name for name, is_needed in own.items() if is_needed]
    if edit.kind == "text":
        return ["instruct-pix2pix"] * (edit.text.guidance == "instruct_pix2pix")
    return ["mobile_sam"] * (edit.kind == "segment" and edit.segment.masks == "mobile_sam")


def _recipe(config: DictConfig) -> Recipe:
    from texgs.edit.recipe import preset

    image = config.edit.image
    changes = {key: image[key] for key in ("iterations", "lambda_s") if image[key] is not None}
    return preset(image.recipe, **changes)


def weights_of(stage: str, config: DictConfig, checksums: Checksums) -> dict[str, str | None]:
    """Checksums of all weights that a stage may work with, None for those that are not on this machine.

    They are part of a job's settings: when weights arrive or change, what used them is made again.

    Args:
        stage: name of the stage.
        config: of one edit, or of none.
        checksums: what is known of files.
    """
    if stage == "edit_metrics":
        names = ["vgg16", "lpips_vgg", config.metric.clip]
    elif stage in ("edit_image", "edit_text", "edit_segment"):
        names = needed(config)
        if config.edit.kind == "image" and _recipe(config).needs_clip:
            names = [*names, config.metric.clip]
    else:
        return {}
    return {name: _short(name, checksums) for name in dict.fromkeys(names)}


def _short(name: str, checksums: Checksums) -> str | None:
    from texgs.models.weights import checksum

    found = checksum(name, checksums)
    return found and found[:SHOWN]


def require_same(recorded: Mapping[str, str | None]) -> None:
    """Require that the weights on this machine are those of a job's settings.

    Raises:
        MissingDataError: naming the weights that came, went or changed since the job was planned.
    """
    checksums = Checksums.load()
    for name, expected in recorded.items():
        if (found := _short(name, checksums)) != expected:
            raise MissingDataError(
                f"weights of {name}: expected {expected or 'none'}, as when the job was planned, "
                f"got {found or 'none'}; run the same command again"
            )


def missing(config: DictConfig) -> list[str]:
    """What is said of weights that an edit needs and this machine has not; nothing is downloaded."""
    from texgs.models.weights import available

    return [
        f"edit {config.edit.name}: the weights of {name} are not on this machine; "
        f"`texgs weights {name}` downloads them or says how to get them"
        for name in needed(config)
        if not available(name)
    ]
