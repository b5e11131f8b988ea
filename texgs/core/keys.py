"""Dataclasses as schemas: how they declare keys, and plain values as instances of them."""

import typing
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass
from functools import cache
from itertools import repeat
from operator import ge, gt, le, lt
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, cast

from texgs.core.errors import ArgumentError, errors_at
from texgs.core.names import close, is_number

T = TypeVar("T")
MAX_INTEGER = 2**63 - 1
REQUIRED = "???"  # the default of a key that has none, in Hydra's words
BOOLEANS = {
    **dict.fromkeys(("true", "yes", "on", "y", "1"), True),
    **dict.fromkeys(("false", "no", "off", "n", "0"), False),
}
TYPE_WORDS = {int: "an integer", float: "a number", bool: "true or false", str: "text"}
MAX_LETTERS = 60  # letters of a value in a sentence


@dataclass(frozen=True)
class Bounds:
    """The numbers that are allowed."""

    least: float | None = None
    most: float | None = None
    above: float | None = None
    below: float | None = None

    def complaint(self, value: float) -> str | None:
        """Return what was expected of a number that is not allowed; None for one that is."""
        if isinstance(value, int) and abs(value) > MAX_INTEGER:
            return "an integer of 64 bits"
        if not is_number(value):
            return "a finite number"
        limits = (
            (self.least, ge, "at least"),
            (self.most, le, "at most"),
            (self.above, gt, "more than"),
            (self.below, lt, "less than"),
        )
        for limit, holds, words in limits:
            if limit is not None and not holds(value, limit):
                return f"{words} {limit:g}"
        return None


def key(
    default: Any,
    help: str,
    unit: str = "",
    *,
    choices: tuple[str, ...] = (),
    items: tuple[int, int] | None = None,
    option: str = "",
    **bounds: float | None,
) -> Any:
    """Return a dataclass field that `--help` and the checks can read.

    A class as default gives each its own instance, and a list its own copy. Numbers have the unit and bounds
    by the names of `Bounds`: least, most, above, below.

    Args:
        default: value, `REQUIRED` for none.
        help: what it is, in a few words.
        unit: of its numbers.
        choices: that it is one of.
        items: of a list: how many at least and at most.
        option: its name on a command line, where that differs from the field's.
        **bounds: of its numbers, however deep in lists.
    """
    metadata: dict[str, Any] = {"help": help, "unit": unit, "choices": choices, "bounds": Bounds(**bounds)}
    metadata |= {"items": items, "option": option}
    if isinstance(default, type):
        return field(default_factory=default, metadata=metadata)
    if isinstance(default, list):
        return field(default_factory=lambda: list(default), metadata=metadata)
    return field(default=default, metadata=metadata)


def numbers(value: Any) -> Iterator[int | float]:
    """Yield the numbers in a value: itself, or those of a list of lists, however deep."""
    if isinstance(value, Sequence) and not isinstance(value, str):
        for item in value:
            yield from numbers(item)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield value


class ValueMismatch(ValueError):
    """A value is not what its dataclass says; or a key is unknown or missing. Borders say in which file."""

    def __init__(self, key: str, problem: str, value: Any = None) -> None:
        super().__init__(f"{key}: {problem}" if key else problem)
        self.key, self.problem, self.value = key, problem, value


class UnknownKey(ValueMismatch):
    """A key that the dataclass does not have."""


class MissingKey(ValueMismatch):
    """A key without a value that has no default."""


def typed(kind: type[T], values: Mapping[str, Any], key: str = "") -> T:
    """Return an instance of a dataclass, its parts too, from plain values by the names of its fields.

    The dataclass is of lists, tuples, tables with any names, further dataclasses, and single values. Fields
    that are not given get their defaults. Messages, of a ValueMismatch, put the key in front of the names.
    """
    known = fields_of(cast(Any, kind))
    made = {}
    for name, value in _table(values, key).items():
        at = f"{key}.{name:.{MAX_LETTERS}}" if key else f"{name:.{MAX_LETTERS}}"
        if name not in known:
            raise UnknownKey(at, f"no such key{close(name, known)}", value)
        hint, field = known[name]
        made[name] = _value(hint, value, at)
        _check(field, made[name], value, at)
    for name, (_, field) in known.items():
        at = f"{key}.{name}" if key else name
        is_needed = field.default is MISSING and field.default_factory is MISSING
        if made.get(name, REQUIRED if is_needed else field.default) == REQUIRED:
            raise MissingKey(at, "expected a value, got none")
    return kind(**made)


def typed_argument(kind: type[T], values: Mapping[str, Any], key: str = "") -> T:
    """Return what `typed` does. What is wrong is an ArgumentError that begins with the key."""
    try:
        with errors_at(key) if key else nullcontext():
            return typed(kind, values, key)
    except ValueMismatch as error:
        raise ArgumentError(str(error)) from error


def require_keys(values: Any, keys: Collection[str] | None, where: str) -> None:
    """Require a table with known keys; the error for an unknown key names the most similar one."""
    if not isinstance(values, dict):
        raise ArgumentError(f"{where}: expected a table of keys and values, got {values!r}")
    for key in values if keys is not None else ():
        if key not in keys:  # type: ignore[operator]
            hint = close(key, keys or ()) or f"; expected {', '.join(keys or ())}"
            raise ArgumentError(f"{where}: no such key {key!r}{hint}")


def mismatch(key: str, expected: str, value: Any) -> ValueMismatch:
    """Return the error for a value that is not what is expected."""
    kinds = {NoneType: "null", bool: str(value).lower(), str: repr(value)}
    if isinstance(value, Mapping):
        got = "keys with values"
    elif isinstance(value, Sequence) and not isinstance(value, str):
        got = "a list"
    else:
        got = kinds.get(type(value), str(value))
    if len(got) > MAX_LETTERS:
        got = f"{got[:MAX_LETTERS]}... ({len(got)} characters)"
    return ValueMismatch(key, f"expected {expected}, got {got}", value)


@cache
def fields_of(kind: Any) -> dict[str, tuple[Any, Field[Any]]]:
    """Return the types and fields of a dataclass by name."""
    hints = typing.get_type_hints(kind)
    return {field.name: (hints[field.name], field) for field in fields(kind) if field.init}


def _table(value: Any, key: str) -> dict[str, Any]:
    """Require keys with values."""
    if not isinstance(value, Mapping):
        raise mismatch(key, "keys with values", value)
    return {str(name): each for name, each in value.items()}


def _value(hint: Any, value: Any, key: str) -> Any:
    """Return a value as the type that is asked for; tables and lists as copies."""
    if (inner := without_none(hint)) is not hint:
        return None if value is None else _value(inner, value, key)
    if is_dataclass(hint):
        return value if isinstance(value, hint) else typed(hint, value, key)  # type: ignore[arg-type]
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    is_list = isinstance(value, Sequence) and not isinstance(value, str)
    if origin in (list, tuple) and not is_list:
        raise mismatch(key, f"a list, [{value}]" if isinstance(value, str) else "a list", value)
    if origin is list or (hint is Any and is_list):
        return [_value((*arguments, Any)[0], each, f"{key}.{index}") for index, each in enumerate(value)]
    if origin is tuple:
        if arguments[-1] is not ... and len(value) != len(arguments):
            raise ValueMismatch(key, f"expected {len(arguments)} values, got {len(value)}", value)
        hints = repeat(arguments[0]) if arguments[-1] is ... else arguments
        pairs = zip(hints, value, strict=False)
        return tuple(_value(each, item, f"{key}.{index}") for index, (each, item) in enumerate(pairs))
    if origin is Literal:
        return _chosen(arguments, value, key)
    if origin is dict or (hint is Any and isinstance(value, Mapping)):
        inner = arguments[1] if arguments else Any
        return {name: _value(inner, each, f"{key}.{name}") for name, each in _table(value, key).items()}
    if hint is not Any:
        return _single(hint, value, key)
    if value is None or isinstance(value, str | int | float):
        return value
    raise mismatch(key, "text, a number, a list or keys with values", value)


def choices_of(hint: Any, field: Field[Any]) -> tuple[str, ...]:
    """Return what a key is one of; nothing where any value will do."""
    is_literal = typing.get_origin(without_none(hint)) is Literal
    return typing.get_args(without_none(hint)) if is_literal else field.metadata.get("choices", ())


def without_none(hint: Any) -> Any:
    """Return the type of what may also be None; any other type as it is."""
    if isinstance(hint, UnionType) or typing.get_origin(hint) is typing.Union:
        return next(each for each in typing.get_args(hint) if each is not NoneType)
    return hint


def _single(hint: type, value: Any, key: str) -> Any:
    """Return a single value; text that says a number or a boolean is taken for one, as in a shell."""
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if hint is bool and isinstance(value, bool | int | str):
        if (known := BOOLEANS.get(str(value).lower())) is not None:
            return known
    elif hint is str and isinstance(value, str | int | float):
        return str(value)
    elif (hint is float and is_number) or (hint in (int, float) and isinstance(value, int | str)):
        try:
            return hint(value)
        except OverflowError as error:
            raise mismatch(key, "a finite number", value) from error
        except ValueError:
            pass  # told below
    raise mismatch(key, TYPE_WORDS[hint], value)


def _chosen(choices: Sequence[str], value: Any, key: str) -> str:
    """Return a value that is one of the choices."""
    if value not in choices:
        got = f"{value!s:.{MAX_LETTERS}}{close(value, choices)}"
        raise ValueMismatch(key, f"expected one of {', '.join(choices)}, got {got}", value)
    return str(value)


def _check(field: Field[Any], value: Any, given: Any, key: str) -> None:
    """Require a value that its field allows; `given` is what it was made of."""
    choices, bounds = field.metadata.get("choices"), field.metadata.get("bounds")
    if choices and value is not None:
        _chosen(choices, value, key)
    items = field.metadata.get("items")
    if items and value is not None and not items[0] <= len(value) <= items[1]:
        raise ValueMismatch(key, f"expected {items[0]} to {items[1]} values, got {len(value)}", given)
    for number in numbers(value) if bounds else ():
        if bounds and (expected := bounds.complaint(number)):
            problem = str(mismatch("", expected, number))
            raise ValueMismatch(key, problem, given)
