"""Kinds of field: what each can do, and how its files are known, read, written and made a scene.

A kind is one module of this package, which defines FIELD. How it is fitted stands in `texgs.fitting.kinds`,
or as FIT in the same module.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

from texgs.core.errors import ConfigError
from texgs.core.specifications import specifications

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


class Functions(NamedTuple):
    """What is done with fields of one kind."""

    read: Callable[[Path], Any]
    write: Callable[[Path, Any], Path]
    compose: Callable[[Sequence[Any], Sequence[Sequence[Any]]], Any]


@dataclass(frozen=True)
class Kind:
    """One kind of field. Its module imports nothing heavy before `functions` is called."""

    name: str
    formats: tuple[str, ...]  # entries of headers by which its files are known
    can: frozenset[Capability]  # what edits may do with it
    functions: Callable[[], Functions]  # imports what reads, writes and composes it
    exports: tuple[str, ...] = ()  # what `texgs export` writes of it
    depth: Literal["", "median", "depth"] = ""  # which of its outputs meshes are made of, if it has one
    film_size: int = 320  # pixels of a side of its films of edits; fewer where a frame takes seconds

    @property
    def module(self) -> str:
        """The module that defines it."""
        return self.functions.__module__

    def read(self, path: Path) -> Any:
        """Read the `Field` in a file."""
        return self.functions().read(path)

    def write(self, path: Path, field: Any) -> Path:
        """Write the file of a `Field` in one step."""
        return self.functions().write(path, field)

    def compose(self, fields: Sequence[Any], segments: Sequence[Sequence[Any]]) -> Any:
        """Make one `Composed` of fields and the masks of their segments."""
        return self.functions().compose(fields, segments)


def kinds() -> dict[str, Kind]:
    """Return all kinds by name."""
    return specifications(__name__, "FIELD")


def require(kind: str, needs: Collection[str], what: str, only: Collection[str] = ()) -> None:
    """Require of a kind of field that it is capable of something, or one of some kinds."""
    if only and kind not in only:
        raise ConfigError(f"{what}: expected a fit of {' or '.join(sorted(only))}, got one of {kind}")
    if missing := sorted(set(needs) - kinds()[kind].can):
        able = [name for name, other in kinds().items() if set(needs) <= other.can]
        raise ConfigError(
            f"{what}: expected a fit of {' or '.join(able)}, got one of {kind}, "
            f"which has no {', '.join(missing)}"
        )
