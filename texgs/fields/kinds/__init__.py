"""Kinds of field: capabilities of each, and how its files are recognised, read, written and composed.

Those of texgs stand in `builtin`. Another kind is a module of this package that defines FIELD, and FIT, how
it is fitted.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

from texgs.core.errors import ConfigError
from texgs.core.specifications import import_name, specifications

Capability = Literal[
    "relight",  # light and material may change
    "unlit",  # it can show colours without light
    "palette",  # its colour may be replaced
    "texture",  # looks may change within a primitive
    "opacity",  # it may become fainter
    "segments",  # parts of it may be edited
    "normals",  # it renders normals
]
ALL: frozenset[Capability] = frozenset(get_args(Capability))


@dataclass(frozen=True)
class Kind:
    """One kind of field. Its functions are named as "module:function" and imported on use."""

    name: str
    formats: tuple[str, ...]  # header entries that identify its files
    can: frozenset[Capability]  # for edits
    reader: str  # function of a file
    writer: str  # function of a path and a field
    composer: str  # function of fields and the masks of their segments
    exports: tuple[str, ...] = ()  # kinds of file that `texgs export` writes
    depth: Literal["", "median", "depth"] = ""  # output for meshes, if any
    film_size: int = 320  # pixels of a side of films of edits; fewer if frames take seconds

    @property
    def modules(self) -> tuple[str, ...]:
        """Its modules for reading, writing and composing."""
        names = (self.reader, self.writer, self.composer)
        return tuple(dict.fromkeys(name.partition(":")[0] for name in names))

    def read(self, path: Path) -> Any:
        """Read the `Field` in a file."""
        return import_name(self.reader)(path)

    def write(self, path: Path, field: Any) -> Path:
        """Write the file of a `Field` in one step."""
        written: Path = import_name(self.writer)(path, field)
        return written

    def compose(self, fields: Sequence[Any], segments: Sequence[Sequence[Any]]) -> Any:
        """Compose fields and the masks of their segments into one `Composed`."""
        return import_name(self.composer)(fields, segments)


def kinds() -> dict[str, Kind]:
    """Return all kinds by name."""
    return specifications(__name__, "FIELD")


def require(kind: str, needs: Collection[str], what: str, only: Collection[str] = ()) -> None:
    """Require a capability of a kind of field, or one of some kinds."""
    if only and kind not in only:
        raise ConfigError(f"{what}: expected a fit of {' or '.join(sorted(only))}, got one of {kind}")
    if missing := sorted(set(needs) - kinds()[kind].can):
        able = [name for name, other in kinds().items() if set(needs) <= other.can]
        raise ConfigError(
            f"{what}: expected a fit of {' or '.join(able)}, got one of {kind}, "
            f"which has no {', '.join(missing)}"
        )
