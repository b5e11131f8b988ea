"""What a method of editing is, and the methods that there are: the modules of texgs/edit/methods.

All that has to know of methods reads their specifications: the schema, the command line, the plan of the
workflow, the check of weights, the tables. A method is one file there, and a file of conf/edit for each set
of its values.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from texgs.core.errors import ConfigError
from texgs.core.keys import typed
from texgs.core.names import close
from texgs.core.specifications import require_call, specifications
from texgs.fields.kinds import ALL, kinds

if TYPE_CHECKING:
    from texgs.edit.style_picture import StylePicture

PACKAGE = "texgs.edit.methods"
NO_METHOD = "none"  # of scenes as they are fitted


@dataclass(frozen=True)
class MethodKeys:
    """Keys of a method, `edit.NAME` in the configuration, and what follows from them alone."""

    node = ""  # `edit.NAME`, for messages; `Method` sets it

    def check(self) -> None:
        """Raise an ArgumentError for invalid settings."""

    def check_fit(self, fit: Any) -> None:
        """Raise an ArgumentError if the settings contradict those of the fit, the node `fit`."""

    def weights(self) -> Mapping[str, str]:
        """Return the names of required weights, each with the setting that avoids them, or ""."""
        return {}

    def files(self) -> Mapping[str, Path]:
        """Return the files to read besides scene and views."""
        return {}

    def adds(self, models: Sequence[str]) -> Sequence[str]:
        """Return the parts that the edit adds to a scene of these models."""
        return ()

    def picture(self) -> StylePicture | None:
        """Return the style to compare the result with, or None unless there is exactly one."""
        return None

    def followed(self) -> str:
        """Return the picture's name or the words that an edit follows, for tables."""
        return ""

    def numbers(self) -> Mapping[str, Any]:
        """Return the numbers of the chosen recipe, with all changes to it."""
        return {}


Settings = TypeVar("Settings", bound=MethodKeys)


@dataclass(frozen=True)
class Method(Generic[Settings]):
    """One way to edit a scene. Its module imports nothing heavy before one of these functions is called."""

    name: str
    summary: str  # what it does, in `texgs --help`
    settings: type[Settings]  # dataclass of its keys
    run: Callable[[Any], Any]  # from a `Task[Settings]` of texgs/edit/task.py to an `EditedScene`
    needs: frozenset[str] = frozenset()  # required capabilities of fields, see `Capability`
    fields: frozenset[str] = frozenset()  # kinds of field it supports; empty: all with these capabilities
    follows: str = ""  # its key that a data set's looks supply: "style" or "instruction"
    is_look: bool = True  # whether it changes the look of the scene

    def __post_init__(self) -> None:
        if not self.name.isidentifier():
            raise ConfigError(f"METHOD: expected letters, digits and _ in its name, got {self.name!r}")
        if not self.summary:
            raise ConfigError(f"method {self.name}: summary: expected words for texgs --help, got none")
        require_call(f"method {self.name}", self.run, "task")
        self._require_keys()
        self.settings.node = f"edit.{self.name}"
        if plain := [each.name for each in fields(self.settings) if "help" not in each.metadata]:
            raise ConfigError(f"method {self.name}: {plain[0]}: expected key(DEFAULT, HELP), got no key()")
        if isinstance(self.needs, str):
            raise ConfigError(f"method {self.name}: needs: expected a set, {{{self.needs!r}}}, got text")
        if unknown := sorted(self.needs - ALL):
            hint = close(unknown[0], ALL)
            raise ConfigError(f"method {self.name}: needs: {unknown[0]} is nothing that fields can do{hint}")

    def _require_keys(self) -> None:
        """Require a separate dataclass for the keys."""
        keys, name = self.settings, getattr(self.settings, "__name__", self.settings)
        if not isinstance(keys, type) or not issubclass(keys, MethodKeys):
            raise ConfigError(f"method {self.name}: expected keys of a subclass of MethodKeys, got {name}")
        if "__dataclass_params__" not in vars(keys):
            raise ConfigError(f"method {self.name}: {name}: write @dataclass(frozen=True) above it")

    @property
    def stage(self) -> str:
        """Return its verb, also the name of its stage in the workflow."""
        return f"edit_{self.name}"

    @property
    def module(self) -> str:
        """Return the module that defines it."""
        return self.settings.__module__

    def takes(self, kind: str) -> bool:
        """Return whether it can edit a kind of field."""
        return (not self.fields or kind in self.fields) and self.needs <= kinds()[kind].can

    def of(self, edit: Any, followed: str | None = None) -> Settings:
        """Return its settings from an edit: the schema's `Edit`, or its node in a configuration.

        `followed`, a picture or an instruction, overrides the settings.
        """
        values = getattr(edit, self.name)
        settings: Any = values if isinstance(values, self.settings) else typed(self.settings, values)
        return settings if followed is None else replace(settings, **{self.follows: followed})


def methods() -> dict[str, Method[Any]]:
    """Return all methods by name."""
    return specifications(PACKAGE, "METHOD")


def method_of(edit: Any) -> Method[Any]:
    """Return the method of an edit; the edit `none` has no method (KeyError)."""
    return methods()[edit.method]
