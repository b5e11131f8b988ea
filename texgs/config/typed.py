"""Plain values as instances of the dataclasses that describe them."""

from collections.abc import Mapping
from typing import Any, TypeVar, cast

T = TypeVar("T")


def typed(kind: type[T], values: Mapping[str, Any]) -> T:
    """An instance of a dataclass, its parts too, from plain values.

    Raises:
        OmegaConfBaseException: for a key that is unknown or missing, or a value of another type.
    """
    from omegaconf import OmegaConf  # not at the top: the list of verbs needs methods, and none of this

    merged = OmegaConf.merge(OmegaConf.structured(kind), OmegaConf.create(dict(values)))
    return cast(T, OmegaConf.to_object(merged))
