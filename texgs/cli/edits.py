"""Mistakes in the configuration of an edit, told before any job runs and any earlier result goes."""

from typing import Any

import torch
from omegaconf import DictConfig, OmegaConf

from texgs.cli.segments import require_name, voting_views
from texgs.cli.stages.edit_image import picture_of, recipe_of
from texgs.cli.stages.edit_segment import DISTANCE, FOV, clicks_of
from texgs.cli.stages.parts import shares
from texgs.config.compose import compose
from texgs.config.edits import lineage
from texgs.config.inputs import scene_before
from texgs.config.project import members
from texgs.core.errors import MissingDataError
from texgs.models.filters.vocabulary import understand
from texgs.models.guidance import require_instruction


def require_base(words: tuple[str, ...]) -> None:
    """Require of an edit by hand that what it starts from is there, and has the parts that it changes.

    Raises:
        ConfigError, MissingDataError: naming what is not.
    """
    config = compose(words)
    if config.edit.base in members("edit") and scene_before(config).is_file():
        return  # it may have been made with other words than those of conf/edit: the parts it has count
    chain = lineage(words)
    if config.edit.base is not None and not scene_before(config).is_file():
        name, before = chain[-2]
        raise MissingDataError(
            f"edit.base: {name} is not done yet; run texgs edit_{compose(before).edit.kind} edit={name} first"
        )


def check_edit(config: DictConfig) -> None:
    """Require of an edit all that can be told without its scene and without weights.

    Raises:
        ArgumentError: naming what is not as it should be.
    """
    values: Any = OmegaConf.to_container(config.edit, resolve=True)
    check = {"image": _image, "text": _text, "segment": _segment}.get(values["kind"])
    if check is not None:
        check(values)


def _image(edit: dict[str, Any]) -> None:
    recipe_of(edit["image"], edit["seed"])
    picture_of(edit["image"]["style"])
    shares("edit.image.region", edit["image"]["region"])


def _text(edit: dict[str, Any]) -> None:
    instruction = require_instruction(edit["text"]["instruction"])
    if edit["text"]["guidance"] == "filters":
        understand(instruction)


def _segment(edit: dict[str, Any]) -> None:
    wanted = edit["segment"]
    require_name(wanted["name"], "edit.segment.name")
    clicks_of(wanted, torch.device("cpu"))
    voting_views(wanted["views"], DISTANCE, FOV, wanted["size"])
