"""Dataclasses as schemas: how they declare keys, and plain values as instances of them."""

import typing
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass
from functools import cache
from types import NoneType, UnionType
from typing import Any, TypeVar, cast

from texgs.core.names import close, is_number

LARGEST = 2**63 - 1
REQUIRED = "???"  # the default of a key that has none, in Hydra's words


@dataclass(frozen=True)
class Bounds:
    """The numbers that are allowed."""

    least: float | None = None
    most: float | None = None
    above: float | None = None
    below: float | None = None

    def complaint(self, value: float) -> str | None:
        """What was expected of a number that is not allowed; None for one that is."""
        if isinstance(value, int) and abs(value) > LARGEST:
            return "an integer of 64 bits"
        if not is_number(value):
            return "a finite number"
        if self.least is not None and value < self.least:
            return f"at least {self.least:g}"
        if self.most is not None and value > self.most:
            return f"at most {self.most:g}"
        if self.above is not None and value <= self.above:
            return f"more than {self.above:g}"
        if self.below is not None and value >= self.below:
            return f"less than {self.below:g}"
        return None


def key(
    default: Any,
    help: str,
    unit: str = "",
    *,
    choices: tuple[str, ...] = (),
    least: float | None = None,
    most: float | None = None,
    above: float | None = None,
    below: float | None = None,
) -> Any:
    """A dataclass field that `--help` and the checks can read.

    Args:
        default: a value, a class (one instance each), or a list (a copy each).
        help: what the key means.
        unit: of its numbers.
        choices: the only values allowed, where these are few.
        least: the smallest number allowed.
        most: the largest number allowed.
        above: numbers must be larger.
        below: numbers must be smaller.
    """
    bounds = Bounds(least, most, above, below)
    metadata = {"help": help, "unit": unit, "choices": choices, "bounds": bounds}
    if isinstance(default, type):
        return field(default_factory=default, metadata=metadata)
    if isinstance(default, list):
        return field(default_factory=lambda: list(default), metadata=metadata)
    return field(default=default, metadata=metadata)


def numbers(value: Any) -> Iterator[int | float]:
    """The numbers in a value: itself, or those of a list of lists, however deep."""
    if isinstance(value, Sequence) and not isinstance(value, str):
        for item in value:
            yield from numbers(item)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield value


T = TypeVar("T")
BOOLEANS = {
    **dict.fromkeys(("true", "yes", "on", "y", "1"), True),
    **dict.fromkeys(("false", "no", "off", "n", "0"), False),
}
EXPECTED = {int: "an integer", float: "a number", bool: "true or false", str: "text"}
LONGEST = 60  # letters of a value in a sentence


class ValueMismatch(ValueError):
    """A value is not what its dataclass says; or a key is unknown or missing. Borders say in which file."""

    def __init__(self, key: str, problem: str, value: Any = None) -> None:
        super().__init__(f"{key}: {problem}" if key else problem)
        self.key, self.value = key, value


class UnknownKey(ValueMismatch):
    """A key that the dataclass does not have."""


class MissingKey(ValueMismatch):
    """A key without a value that has no default."""


def typed(kind: type[T], values: Mapping[str, Any], key: str = "") -> T:
    """Return an instance of a dataclass, its parts too, from plain values.

    Args:
        kind: of lists, tables with any names, further dataclasses, and single values.
        values: by the names of its fields; those that are not given get their defaults.
        key: of the values, in front of the names in messages.

    Raises:
        ValueMismatch: for a name that is unknown or missing, a value of another type, and one that its field
            does not allow.
    """
    if not isinstance(values, Mapping):
        raise mismatch(key, "keys with values", values)
    known = _fields(cast(Any, kind))
    made = {}
    for name, value in values.items():
        at = f"{key}.{name}" if key else str(name)
        if name not in known:
            raise UnknownKey(at, f"no such key{close(str(name), known)}", value)
        hint, field = known[name]
        made[name] = _value(hint, value, at)
        _check(field, made[name], value, at)
    for name, (_, field) in known.items():
        at = f"{key}.{name}" if key else name
        is_needed = field.default is MISSING and field.default_factory is MISSING
        if made.get(name, REQUIRED if is_needed else field.default) == REQUIRED:
            raise MissingKey(at, "expected a value, got none")
    return kind(**made)


def mismatch(key: str, expected: str, value: Any) -> ValueMismatch:
    """Return the error for a value that is not what is expected."""
    kinds = {NoneType: "null", bool: str(value).lower(), str: repr(value)}
    if isinstance(value, Mapping):
        got = "keys with values"
    elif isinstance(value, Sequence) and not isinstance(value, str):
        got = "a list"
    else:
        got = kinds.get(type(value), str(value))
    if len(got) > LONGEST:
        got = f"{got[:LONGEST]}... ({len(got)} characters)"
    return ValueMismatch(key, f"expected {expected}, got {got}", value)


@cache
def _fields(kind: Any) -> dict[str, tuple[Any, Field[Any]]]:
    hints = typing.get_type_hints(kind)
    return {field.name: (hints[field.name], field) for field in fields(kind) if field.init}


def _value(hint: Any, value: Any, key: str) -> Any:
    """Return a value as the type that is asked for."""
    if hint is Any:
        return _plain(value, key)
    if isinstance(hint, UnionType):
        inner = next(each for each in hint.__args__ if each is not NoneType)
        return None if value is None else _value(inner, value, key)
    if is_dataclass(hint):
        return value if isinstance(value, hint) else typed(hint, value, key)  # type: ignore[arg-type]
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is list:
        if not isinstance(value, Sequence) or isinstance(value, str):
            raise mismatch(key, "a list", value)
        return [_value(arguments[0], each, f"{key}.{index}") for index, each in enumerate(value)]
    if origin is dict:
        if not isinstance(value, Mapping):
            raise mismatch(key, "keys with values", value)
        return {str(name): _value(arguments[1], each, f"{key}.{name}") for name, each in value.items()}
    return _single(hint, value, key)


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
    raise mismatch(key, EXPECTED[hint], value)


def _plain(value: Any, key: str) -> Any:
    """Return a value of any kind that files of configurations can hold; tables and lists as copies."""
    if isinstance(value, Mapping):
        return {str(name): _plain(each, f"{key}.{name}") for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each, f"{key}.{index}") for index, each in enumerate(value)]
    if value is None or isinstance(value, str | int | float):
        return value
    raise mismatch(key, "text, a number, a list or keys with values", value)


def _check(field: Field[Any], value: Any, given: Any, key: str) -> None:
    """Require a value that its field allows; `given` is what it was made of."""
    choices, bounds = field.metadata.get("choices"), field.metadata.get("bounds")
    if choices and value is not None and value not in choices:
        problem = f"expected one of {', '.join(choices)}, got {value:.{LONGEST}}{close(value, choices)}"
        raise ValueMismatch(key, problem, given)
    for number in numbers(value) if bounds else ():
        if bounds and (expected := bounds.complaint(number)):
            problem = str(mismatch("", expected, number))
            raise ValueMismatch(key, problem, given)
