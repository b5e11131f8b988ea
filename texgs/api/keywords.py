"""Keywords of methods from a dataclass of options, which checks them and says what they are."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import Field
from functools import wraps
from inspect import Parameter, Signature, signature
from typing import Any, TypeVar

from texgs.api.display import as_python
from texgs.core.errors import ArgumentError
from texgs.core.keys import ValueMismatch, choices_of, fields_of, typed

T = TypeVar("T")


def takes(schema: Any, *places: str, **defaults: Any) -> Callable[[Callable[..., T]], Callable[..., T]]:
    """Return a decorator of a method whose last argument is a dataclass: callers give its keys instead.

    The signature and the documentation of the method list them, for `help` and for notebooks.

    Args:
        schema: the dataclass, of keys.
        *places: names of keys that need no keyword, in their order.
        **defaults: of keys, where they differ from those of the dataclass.
    """
    keys = {name: each for name, (_, each) in fields_of(schema).items() if "help" in each.metadata}
    names = [*places, *(name for name in keys if name not in places)]

    def decorate(method: Callable[..., T]) -> Callable[..., T]:
        own = list(signature(method).parameters.values())[:-1]
        added = [
            Parameter(
                name,
                Parameter.POSITIONAL_OR_KEYWORD if name in places else Parameter.KEYWORD_ONLY,
                default=defaults.get(name, keys[name].default),
            )
            for name in names
        ]
        taken = Signature([*own, *added])

        @wraps(method)
        def called(*arguments: Any, **keywords: Any) -> T:
            given = taken.bind(*arguments, **keywords).arguments
            values = {name: as_python(given.pop(name)) for name in names if name in given}
            return method(*given.values(), options_of(schema, {**defaults, **values}))

        called.__signature__ = taken  # type: ignore[attr-defined]
        lines = (f"    {name}: {words_of(*fields_of(schema)[name])}." for name in names)
        called.__doc__ = f"{method.__doc__}\n\nKeywords:\n" + "\n".join(lines)
        return called

    return decorate


def words_of(hint: Any, each: Field[Any]) -> str:
    """Return what a key is, with its unit and its choices."""
    choices = ", ".join(choices_of(hint, each))
    parts = (each.metadata["help"], each.metadata["unit"], f"one of {choices}" if choices else "")
    return ", ".join(filter(None, parts))


def options_of(schema: type[T], values: Mapping[str, Any]) -> T:
    """Return a dataclass of values by name; what is wrong with one is an ArgumentError."""
    try:
        return typed(schema, values)
    except ValueMismatch as error:
        raise ArgumentError(str(error)) from error
