"""Weights that the edits of a configuration need, looked for before any job runs."""

from omegaconf import DictConfig

from texgs.core.errors import MissingDataError
from texgs.edit.recipe import preset
from texgs.models.weights import available, locate


def needed(config: DictConfig) -> list[str]:
    """Names of the weights that the edit of a configuration works with."""
    edit = config.edit
    if edit.kind == "image":
        changes = {key: edit.image[key] for key in ("iterations", "lambda_s") if edit.image[key] is not None}
        recipe = preset(edit.image.recipe, **changes)
        clicked = bool(edit.image.region) and edit.image.masks == "mobile_sam"
        asks_for_clip = recipe.needs_clip and edit.image.lambda_s is not None  # else it is left out
        own = {"vgg16": recipe.needs_vgg, config.metric.clip: asks_for_clip, "mobile_sam": clicked}
        return [name for name, is_needed in own.items() if is_needed]
    if edit.kind == "text":
        return ["instruct-pix2pix"] * (edit.text.guidance == "instruct_pix2pix")
    return ["mobile_sam"] * (edit.kind == "segment" and edit.segment.masks == "mobile_sam")


def missing(config: DictConfig, *, download: bool) -> list[str]:
    """What is said of weights that are missing.

    Args:
        config: of one edit.
        download: whether they are downloaded where they can be, or only looked for.
    """
    found = []
    for name in needed(config):
        try:
            if download:
                locate(name)
            elif not available(name):
                found.append(f"edit {config.edit.name}: the weights of {name} are not on this machine yet")
        except MissingDataError as error:
            found.append(f"edit {config.edit.name}: {error}")
    return found
