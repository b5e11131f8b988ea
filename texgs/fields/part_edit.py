"""Photorealistic edits of a basic model in a scene: numbers, applied to every frame."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

from texgs.core.colors import Color, color
from texgs.core.errors import ArgumentError
from texgs.core.keys import require_keys
from texgs.core.names import is_number
from texgs.fields.kinds import kinds

MAX_FACTOR = 1000.0  # a larger factor is a typing error
MAX_OPACITY = 1 - 1e-6  # opacity with a finite logit
# Capability of a field that each value of an edit requires; all other values are factors of a material.
NEEDS = {"visible": "opacity", "opacity": "opacity", "palette": "palette"}
LOOKS = ("style", "picture", "instruction")  # keys of looks, which are not changes of numbers


@dataclass(frozen=True)
class PartEdit:
    """Edits of one part of a scene by numbers; the defaults change nothing.

    Raises:
        ArgumentError: naming the value that is out of range.
    """

    visible: bool = True
    palette: Color | None = None  # colour in [0, 1]; None: as fitted
    opacity: float = 1.0  # factor on opacities, which stay at most 1
    ambient: float = 1.0  # factors on k_a, k_d, k_s and beta
    diffuse: float = 1.0
    specular: float = 1.0
    shininess: float = 1.0
    tint: Color = (1.0, 1.0, 1.0)  # colour of highlights in [0, 1]

    def __post_init__(self) -> None:
        if not isinstance(self.visible, bool):
            raise ArgumentError(f"visible: expected true or false, got {self.visible!r}")
        if self.palette is not None:
            object.__setattr__(self, "palette", color("palette", self.palette))
        object.__setattr__(self, "tint", color("tint", self.tint))
        for each in fields(self)[2:-1]:
            value = getattr(self, each.name)
            if not is_number(value) or not 0 <= value <= MAX_FACTOR:
                raise ArgumentError(f"{each.name}: expected a factor from 0 to {MAX_FACTOR:g}, got {value!r}")

    @property
    def material(self) -> tuple[object, ...]:
        """Return the changed values of the material."""
        return (self.ambient, self.diffuse, self.specular, self.shininess, self.tint)


EDIT_KEYS = tuple(each.name for each in fields(PartEdit))
SEGMENT_KEYS = ("file", "texture", *EDIT_KEYS)  # of a part of a scene


def require_part_key(word: str) -> None:
    """Require that parts of scenes have the key of a change such as TF01.opacity=0.5; other words pass."""
    part, dot, key = word.partition("=")[0].rpartition(".")
    if dot and part != "cut" and key not in LOOKS and "/" not in key:
        require_keys({key: None}, SEGMENT_KEYS, f"models.{part.replace('/', '.segments.')}")


def require_possible(edit: PartEdit, kind: str) -> None:
    """Require that a kind of field can show an edit; default values always pass."""
    for each in fields(edit):
        needs = NEEDS.get(each.name, "relight")
        if needs not in kinds()[kind].can and getattr(edit, each.name) != each.default:
            able = " or ".join(name for name, other in kinds().items() if needs in other.can)
            raise ArgumentError(f"{each.name}: expected a model that can change it, got {kind}; fit {able}")


def opacity_factors(edits: Sequence[PartEdit] | None, count: int, kind: str) -> list[float]:
    """Return a factor on the opacity of each of `count` fields of a kind that supports no other edit.

    It is 0 for hidden fields, and 1 without edits.
    """
    if edits is None:
        return [1.0] * count
    if len(edits) != count:
        raise ArgumentError(f"edits: expected one for each of {count} models, got {len(edits)}")
    for edit in edits:
        require_possible(edit, kind)
    return [edit.opacity if edit.visible else 0.0 for edit in edits]
