"""Keys common to all edits of a scene."""

from dataclasses import dataclass

from texgs.core.keys import REQUIRED, key
from texgs.edit.method import NO_METHOD, methods


@dataclass(frozen=True)
class EditKeys:
    """One edit of a scene. It may start from the result of another one."""

    name: str = key(REQUIRED, "name, also of its folder; that of its file in conf/edit")
    method: str = key(NO_METHOD, "how the scene is edited", choices=(NO_METHOD, *methods()))
    base: str | None = key(
        None, "edit whose scene this starts from, or a scene.yaml file; default the scene as fitted"
    )
    parts: list[str] = key(
        [], "MODEL/SEGMENT, or models without their segments, that get the new look; default all models"
    )
    looks: bool = key(
        False, "each model follows the picture or the instruction that dataset.looks has for its basic TF"
    )
    compared: bool = key(False, "a method of the paper's comparisons, with rows in its tables")
    seed: int = key(0, "random numbers", least=0)
    source_caption: str = key("", "the scene before, in words, for CLIP's metrics")
    target_caption: str = key("", "the scene afterwards, in words, for CLIP's metrics")
