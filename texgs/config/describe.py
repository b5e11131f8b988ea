"""All keys of the schema as a list, for `--help` and for checks."""

import dataclasses
import typing
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from types import UnionType
from typing import Any

from texgs.config.schema import Config


@dataclass(frozen=True)
class Key:
    """One key of the configuration."""

    name: str  # dotted; `*` stands for any index or name
    type: str
    default: Any
    help: str
    unit: str
    choices: tuple[str, ...]


@cache
def keys() -> tuple[Key, ...]:
    """Return every key, in the order of the schema."""
    return tuple(_walk(Config, ""))


def describe(config: Config) -> str:
    """Return a table of all keys: name, value in a configuration, type, unit, meaning."""
    lines = []
    for entry in keys():
        value = entry.default if "*" in entry.name else value_at(config, entry.name)
        text = "null" if value is None else str(value).lower() if isinstance(value, bool) else str(value)
        unit = f" [{entry.unit}]" if entry.unit else ""
        choices = f"; one of {', '.join(entry.choices)}" if entry.choices else ""
        lines.append(f"  {entry.name}={text}\n      {entry.type}{unit}: {entry.help}{choices}")
    return "\n".join(lines)


def value_at(config: Config, name: str) -> Any:
    """Return the value of a dotted key in nested tables and lists."""
    value: Any = config
    for part in name.split("."):
        if isinstance(value, list):
            value = value[int(part)]
        else:
            value = value[part] if isinstance(value, dict) else getattr(value, part)
    return value


def _walk(table: type, prefix: str) -> Iterator[Key]:
    """Yield the keys of a dataclass and of the dataclasses in its lists and tables."""
    hints = typing.get_type_hints(table)
    for field in dataclasses.fields(table):
        name, hint = f"{prefix}{field.name}", hints[field.name]
        inner = [hint, *typing.get_args(hint)[-1:]]
        if below := next((each for each in inner if dataclasses.is_dataclass(each)), None):
            yield from _walk(typing.cast(type, below), f"{name}." if below is hint else f"{name}.*.")
        else:
            default = None if field.default is dataclasses.MISSING else field.default
            said: dict[str, Any] = {part: field.metadata.get(part) for part in ("help", "unit", "choices")}
            yield Key(name, _type(hint), default, **said)


def _type(hint: Any) -> str:
    """Describe a type in words."""
    if isinstance(hint, UnionType):
        return " or ".join(_type(argument) for argument in typing.get_args(hint))
    if hint is type(None):
        return "null"
    name = hint if typing.get_args(hint) else getattr(hint, "__name__", hint)
    return str(name).replace("typing.", "")
