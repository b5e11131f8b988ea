"""One part of a scene, whose values are those of its edit: reading and setting them is all there is to it."""

from __future__ import annotations

from typing import Any, Generic, TypeVar, cast

from texgs.api.display import as_python
from texgs.fields.part_edit import PartEdit
from texgs.scene.parts import entry_of
from texgs.scene.session import Session

T = TypeVar("T")


class Value(Generic[T]):
    """A value of a part's edit; None takes it back."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._key = name

    def __get__(self, part: Part | None, owner: type) -> T:
        if part is None:
            return cast(T, self)
        return cast(T, getattr(entry_of(part.session.scene, part.name).edit, self._key))

    def __set__(self, part: Part, value: Any) -> None:
        with part.session.one_step(f"{part.name} {self._key} {'as fitted' if value is None else value}"):
            if value is None:
                part.session.reset(part.name, self._key)
            else:
                part.session.set(part.name, self._key, as_python(value))


class Part:
    """A model of a scene, MODEL, or a segment of one, MODEL/SEGMENT; see `texgs.fields.part_edit.PartEdit`.

    Setting a value raises an ArgumentError for one that is out of range or that the model cannot show.
    """

    __slots__ = ("name", "session")  # a slip in the name of a value is an AttributeError

    visible = Value[bool]()
    palette = Value["tuple[float, float, float] | None"]()  # set red, green, blue from 0 to 1, or "#rrggbb"
    opacity = Value[float]()  # factors of what was fitted, from 0 on
    ambient = Value[float]()
    diffuse = Value[float]()
    specular = Value[float]()
    shininess = Value[float]()
    tint = Value["tuple[float, float, float]"]()  # of highlights

    def __init__(self, session: Session, name: str) -> None:
        entry_of(session.scene, name)  # which is there
        self.session, self.name = session, name

    def __repr__(self) -> str:
        """Return the name, and what is edited."""
        entry = entry_of(self.session.scene, self.name)
        edits, fitted = vars(entry.edit), vars(PartEdit())
        changed = [f"{key}={value}" for key, value in edits.items() if value != fitted[key]]
        changed += ["a look"] if getattr(entry, "texture", None) else []
        return f"{self.name}: {', '.join(changed) or 'as fitted'}"
