"""Plain values as instances of the dataclasses that describe them."""

import copy
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, TypeVar, cast

T = TypeVar("T")


@dataclass(frozen=True)
class Written:
    """Plain values as a key of a cache: equal to those that are written in the same way."""

    text: str
    values: Any = field(compare=False)  # not to be changed

    @classmethod
    def of(cls, values: Any) -> "Written":
        """Some values."""
        return cls(repr(values), values)


def typed(kind: type[T], values: Mapping[str, Any]) -> T:
    """An instance of a dataclass, its parts too, from plain values.

    Raises:
        OmegaConfBaseException: for a key that is unknown or missing, or a value of another type.
    """
    from omegaconf import OmegaConf  # not at the top: the list of verbs needs methods, and none of this

    plain = OmegaConf.to_container(values) if OmegaConf.is_config(values) else dict(values)
    return cast(T, copy.deepcopy(_made(cast(Any, kind), Written.of(plain))))


@lru_cache(maxsize=512)
def _made(kind: Any, written: Written) -> Any:
    """The instance of some values. Kept: a plan asks for the same ones hundreds of times."""
    from omegaconf import OmegaConf

    merged = OmegaConf.merge(OmegaConf.structured(kind), OmegaConf.create(written.values))
    return OmegaConf.to_object(merged)
