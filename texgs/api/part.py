"""Values to read and set, and one part of a scene, which has those of its edit."""

from __future__ import annotations

from typing import Any, Generic, Protocol, TypeVar, cast

from texgs.api.display import as_python
from texgs.fields.part_edit import PartEdit
from texgs.scene.parts import entry_of
from texgs.scene.session import Session

T = TypeVar("T")


class Edited(Protocol):
    """A part of a scene with values, or the whole scene, whose name is empty."""

    session: Session
    _part: str


class Value(Generic[T]):
    """A value of an edit. Setting it is a step of the history; None takes the edit back.

    Args:
        words: what it is.
        of: the value of a scene that has it, such as "light"; default the scene or the part itself.
    """

    def __init__(self, words: str = "", of: str = "") -> None:
        self.__doc__, self._of = words, of

    def __set_name__(self, owner: type, name: str) -> None:
        self._key = name

    def __get__(self, of: Edited | None, owner: type) -> T:
        if of is None:
            return cast(T, self)
        scene = of.session.scene
        owned: Any = entry_of(scene, of._part).edit if of._part else scene
        return cast(T, getattr(getattr(owned, self._of) if self._of else owned, self._key))

    def __set__(self, of: Edited, value: Any) -> None:
        words = (of._part, self._key, "as fitted" if value is None else str(value))
        with of.session.one_step(" ".join(filter(None, words))):
            of.session.change(of._part, self._key, as_python(value))


class Part:
    """A model of a scene, MODEL, or a segment of one, MODEL/SEGMENT; see `texgs.fields.part_edit.PartEdit`.

    Setting a value raises an ArgumentError for one that is out of range or that the model cannot show.
    """

    __slots__ = ("_part", "session")  # a slip in the name of a value is an AttributeError

    visible = Value[bool]()
    palette = Value["tuple[float, float, float] | None"]()  # set r, g, b from 0 to 1, "#rrggbb" or "red"
    opacity = Value[float]()  # factors of what was fitted, from 0 on
    ambient = Value[float]()
    diffuse = Value[float]()
    specular = Value[float]()
    shininess = Value[float]()
    tint = Value["tuple[float, float, float]"]()  # of highlights

    def __init__(self, session: Session, name: str) -> None:
        entry_of(session.scene, name)  # refuses a name that is not there
        self.session, self._part = session, name

    @property
    def name(self) -> str:
        """Return MODEL or MODEL/SEGMENT."""
        return self._part

    def __repr__(self) -> str:
        """Return the name, and what is edited."""
        entry = entry_of(self.session.scene, self.name)
        edits, fitted = vars(entry.edit), vars(PartEdit())
        changed = [f"{key}={value}" for key, value in edits.items() if value != fitted[key]]
        changed += ["a look"] if getattr(entry, "texture", None) else []
        return f"{self.name}: {', '.join(changed) or 'as fitted'}"
