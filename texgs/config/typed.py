"""Plain values as instances of the dataclasses that describe them."""

import copy
import pickle
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, TypeVar, cast

T = TypeVar("T")


def typed(kind: type[T], values: Mapping[str, Any]) -> T:
    """An instance of a dataclass, its parts too, from plain values.

    Raises:
        OmegaConfBaseException: for a key that is unknown or missing, or a value of another type.
    """
    from omegaconf import OmegaConf  # not at the top: the list of verbs needs methods, and none of this

    plain = OmegaConf.to_container(values) if OmegaConf.is_config(values) else dict(values)
    return cast(T, copy.deepcopy(_made(cast(Any, kind), pickle.dumps(plain))))


@lru_cache(maxsize=512)
def _made(kind: Any, values: bytes) -> Any:
    """The instance of some values, pickled. Kept: a plan asks for the same ones hundreds of times."""
    from omegaconf import OmegaConf

    merged = OmegaConf.merge(OmegaConf.structured(kind), OmegaConf.create(pickle.loads(values)))
    return OmegaConf.to_object(merged)
