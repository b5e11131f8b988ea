"""What a kind of field is, and the kinds that there are: the modules of texgs/kinds.

All that has to know of kinds reads their specifications: the schema, the workflow's jobs, the files of
scenes, the tables. A kind is one file there (and the representation in texgs/fields), and a file of conf/fit
for each set of its values.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, Literal, TypeVar, get_args

from texgs.core.errors import ConfigError
from texgs.core.specifications import specifications

PACKAGE = "texgs.kinds"
Settings = TypeVar("Settings")
Capability = Literal[
    "relight",  # light and material may change
    "unlit",  # it has colours without light
    "palette",  # its colour may be replaced
    "texture",  # looks may change within a primitive
    "opacity",  # it may become fainter
    "segments",  # parts of it may be edited
    "normals",  # it renders normals
]
ALL: frozenset[Capability] = frozenset(get_args(Capability))


@dataclass(frozen=True)
class Kind(Generic[Settings]):
    """One kind of field. Its module imports nothing heavy before one of these functions is called."""

    name: str
    summary: str
    """What its fit does, in `texgs --help`."""
    formats: tuple[str, ...]
    """Entries of headers by which its files are known."""
    can: frozenset[Capability]
    """What edits may do with it, of `Capability`."""
    read: Callable[[Path], Any]
    """The `Field` in a file."""
    write: Callable[[Path, Any], Path]
    """Writes the file of a `Field` in one step."""
    compose: Callable[[Sequence[Any], Sequence[Sequence[Any]]], Any]
    """Fields and the masks of their segments as one `Composed`."""
    phases: tuple[str, ...]
    """Stages of its fit, in their order; the last makes what scenes are composed of."""
    settings: type[Settings] | None = None
    """Dataclass of the keys of its fit, `fit.NAME`; None for surfels, whose keys are `fit` itself."""
    fit: Callable[[Any], Any] | None = None
    """Fits a field in one phase: from a `FitTask[Settings]` of texgs/fit/task.py to a `Fitted`."""
    check: Callable[[Settings], None] = lambda settings: None
    """Requires settings that fit each other: ArgumentError, with the key, if they do not."""
    exports: tuple[str, ...] = ()
    """What `texgs export` writes of it."""
    depth: Literal["", "median", "depth"] = ""
    """Which of its outputs meshes are made of, "median" or "depth"; empty where it has neither."""
    film_size: int = 320
    """Pixels of a side of its films of edits; fewer where a frame takes seconds."""
    devices: frozenset[str] = frozenset({"cpu", "cuda"})
    """Where it is fitted."""

    @property
    def module(self) -> str:
        """Where it is."""
        return self.read.__module__


def kinds() -> dict[str, Kind[Any]]:
    """All kinds by name."""
    return specifications(PACKAGE, "FIELD")


def require(kind: str, needs: Collection[str], what: str, only: Collection[str] = ()) -> None:
    """Require of a kind of field that it is capable of something, or one of some kinds.

    Raises:
        ConfigError: naming what it cannot do.
    """
    if only and kind not in only:
        raise ConfigError(f"{what}: expected a fit of {' or '.join(sorted(only))}, got one of {kind}")
    if missing := sorted(set(needs) - kinds()[kind].can):
        able = [name for name, other in kinds().items() if set(needs) <= other.can]
        raise ConfigError(
            f"{what}: expected a fit of {' or '.join(able)}, got one of {kind}, "
            f"which has no {', '.join(missing)}"
        )
