"""What a method of editing is, and the methods that there are: the modules of texgs/edit/methods.

All that has to know of methods reads their specifications: the schema, the command line, the plan of the
workflow, the check of weights, the tables. A method is one file there, and a file of conf/edit for each set
of its values.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Generic, TypeVar

from texgs.core.keys import typed
from texgs.core.specifications import specifications
from texgs.fields.kinds import kinds

PACKAGE = "texgs.edit.methods"
NO_METHOD = "none"  # of scenes as they are fitted
Settings = TypeVar("Settings")


@dataclass(frozen=True)
class Method(Generic[Settings]):
    """One way to edit a scene. Its module imports nothing heavy before one of these functions is called."""

    name: str
    summary: str  # what it does, in `texgs --help`
    settings: type[Settings]  # dataclass of its keys, `edit.NAME` in the configuration
    run: Callable[[Any], Any]  # from a `Task[Settings]` of texgs/edit/task.py to an `EditedScene`
    check: Callable[[Settings], None]
    """Raises an ArgumentError for what is wrong with its settings, without scene and weights."""
    weights: Callable[[Settings], Mapping[str, str]]
    """Names of the weights that it needs, each with the word of its settings that does without; or ""."""
    needs: frozenset[str] = frozenset()  # what fields have to be capable of, see `Capability`
    fields: frozenset[str] = frozenset()  # kinds that it is made for; empty: all that can what it needs
    check_fit: Callable[[Settings, Any], None] = lambda settings, fit: None
    """Raises an ArgumentError where its settings do not go with those of the fit, the node `fit`."""
    files: Callable[[Settings], Mapping[str, Path]] = lambda settings: {}  # read besides scene and views
    adds: Callable[[Settings, Sequence[str]], Sequence[str]] = lambda settings, models: ()
    """Parts that the scene has afterwards in addition, from the names of its models."""
    style: Callable[[Settings], Any] | None = None
    """The `StylePicture` that it follows, which the result is compared with; None where there are several."""
    follows: str = ""  # which of its keys, "style" or "instruction", looks of a data set have a value of
    followed: Callable[[Settings], str] = lambda settings: ""
    """What it follows, in tables: the name of a picture, or words."""
    numbers: Callable[[Settings], Mapping[str, Any]] = lambda settings: {}
    """Numbers of the recipe that its settings name, with what they change about it."""
    is_look: bool = True  # whether the scene looks different afterwards

    @property
    def stage(self) -> str:
        """Return its verb, which is its stage in the workflow."""
        return f"edit_{self.name}"

    @property
    def module(self) -> str:
        """Return the module that defines it."""
        return self.settings.__module__

    def takes(self, kind: str) -> bool:
        """Return whether it can edit a kind of field."""
        return (not self.fields or kind in self.fields) and self.needs <= kinds()[kind].can

    def of(self, edit: Any, look: str | None = None) -> Settings:
        """Return its settings among those of an edit: the schema's `Edit`, or its node in a configuration.

        A look is what it follows, where that is not what its settings say.
        """
        values = getattr(edit, self.name)
        settings: Any = values if isinstance(values, self.settings) else typed(self.settings, values)
        return settings if look is None else replace(settings, **{self.follows: look})


def methods() -> dict[str, Method[Any]]:
    """Return all methods by name."""
    return specifications(PACKAGE, "METHOD")


def method_of(edit: Any) -> Method[Any]:
    """Return the method of an edit; the edit `none` has no method (KeyError)."""
    return methods()[edit.method]
