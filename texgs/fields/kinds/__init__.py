"""Kinds of field: what each can do, and how its files are known, read, written and made a scene.

Those of texgs stand in `builtin`. Another kind is a module of this package that defines FIELD, and FIT, how
it is fitted.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

from texgs.core.errors import ConfigError
from texgs.core.specifications import named, specifications

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
class Kind:
    """One kind of field. What handles it is named, as "module:function", and imported when it is used."""

    name: str
    formats: tuple[str, ...]  # entries of headers by which its files are known
    can: frozenset[Capability]  # what edits may do with it
    reader: str  # of a file
    writer: str  # to a path, of a field
    composer: str  # of fields and the masks of the segments of each
    exports: tuple[str, ...] = ()  # what `texgs export` writes of it
    depth: Literal["", "median", "depth"] = ""  # which of its outputs meshes are made of, if it has one
    film_size: int = 320  # pixels of a side of its films of edits; fewer where a frame takes seconds

    @property
    def modules(self) -> tuple[str, ...]:
        """The modules that read, write and compose it."""
        names = (self.reader, self.writer, self.composer)
        return tuple(dict.fromkeys(name.partition(":")[0] for name in names))

    def read(self, path: Path) -> Any:
        """Read the `Field` in a file."""
        return named(self.reader)(path)

    def write(self, path: Path, field: Any) -> Path:
        """Write the file of a `Field` in one step."""
        written: Path = named(self.writer)(path, field)
        return written

    def compose(self, fields: Sequence[Any], segments: Sequence[Sequence[Any]]) -> Any:
        """Make one `Composed` of fields and the masks of their segments."""
        return named(self.composer)(fields, segments)


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
