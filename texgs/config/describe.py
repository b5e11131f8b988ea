"""All keys of the schema as a list, for `--help` and for checks."""

import dataclasses
import typing
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from types import UnionType
from typing import Any

from texgs.config.schema import Config
from texgs.core.keys import Bounds


@dataclass(frozen=True)
class Key:
    """One key of the configuration."""

    name: str  # dotted; `*` stands for any index or name
    type: str
    default: Any
    help: str
    unit: str
    choices: tuple[str, ...]
    bounds: Bounds


@cache
def keys() -> tuple[Key, ...]:
    """Every key, in the order of the schema."""
    return tuple(_walk(Config, ""))


def describe(config: Config) -> str:
    """A table of all keys: name, value, type, unit, meaning.

    Args:
        config: whose values are shown as defaults.
    """
    return "\n".join(f"  {entry.name}={_value(entry, config)}\n      {_meaning(entry)}" for entry in keys())


def value_at(config: Config, name: str) -> Any:
    """Return the value of a key, through tables, lists and tables of any names."""
    value: Any = config
    for part in name.split("."):
        if isinstance(value, list):
            value = value[int(part)]
        else:
            value = value[part] if isinstance(value, dict) else getattr(value, part)
    return value


def _walk(table: type, prefix: str) -> Iterator[Key]:
    hints = typing.get_type_hints(table)
    for field in dataclasses.fields(table):
        name, hint = f"{prefix}{field.name}", hints[field.name]
        below, star = _table(hint)
        if below:
            yield from _walk(below, f"{name}.{star}")
        else:
            default = None if field.default is dataclasses.MISSING else field.default
            told: dict[str, Any] = {
                key: field.metadata.get(key) for key in ("help", "unit", "choices", "bounds")
            }
            yield Key(name, _type(hint), default, **told)


def _table(hint: Any) -> tuple[type | None, str]:
    """The dataclass a hint holds, and `*.` where it is in a list or dict."""
    arguments = typing.get_args(hint)
    if dataclasses.is_dataclass(hint):
        return typing.cast(type, hint), ""
    if arguments and dataclasses.is_dataclass(arguments[-1]):
        return typing.cast(type, arguments[-1]), "*."
    return None, ""


def _type(hint: Any) -> str:
    if isinstance(hint, UnionType):
        return " or ".join(_type(argument) for argument in typing.get_args(hint))
    return (
        "null"
        if hint is type(None)
        else str(getattr(hint, "__name__", hint) if not typing.get_args(hint) else hint).replace(
            "typing.", ""
        )
    )


def _value(entry: Key, config: Config) -> str:
    """The value in a configuration; of keys that come any number of times the schema's default."""
    value = entry.default if "*" in entry.name else value_at(config, entry.name)
    return "null" if value is None else str(value).lower() if isinstance(value, bool) else str(value)


def _meaning(entry: Key) -> str:
    choices = f"; one of {', '.join(entry.choices)}" if entry.choices else ""
    unit = f" [{entry.unit}]" if entry.unit else ""
    return f"{entry.type}{unit}: {entry.help}{choices}"
