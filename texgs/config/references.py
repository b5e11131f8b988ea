"""References to other keys in values: `${dataset.image}`, or `${.name}` for a neighbour."""

import re
from collections.abc import Iterator
from typing import Any, cast

from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

from texgs.core.errors import ConfigError
from texgs.core.keys import ValueMismatch

REFERENCE = re.compile(r"(?<!\\)\$\{(\.*)([\w.-]+)\}")
DEEPEST = 20  # references that refer to another one


def resolve(values: dict[str, Any]) -> dict[str, Any]:
    """Replace the references in values, in place where these are simple; return the values.

    Those with resolvers, such as ${oc.env:HOME}, are left to OmegaConf.

    Raises:
        ValueMismatch: for a text that is no reference.
        OmegaConfBaseException: from there.
        ConfigError: for a key that is not there.
    """
    found = list(_texts(values, ()))
    others = [(path, text) for _, _, path, text in found if "${" in REFERENCE.sub("", text)]
    for path, text in others:
        try:
            OmegaConf.create([text])
        except OmegaConfBaseException as error:
            raise ValueMismatch(".".join(path), str(error).splitlines()[0], text) from error
    if others:
        return cast(dict[str, Any], OmegaConf.to_container(OmegaConf.create(values), resolve=True))
    for table, name, path, text in found:
        table[name] = _value(values, text, path, DEEPEST)
    return values


def _texts(table: Any, path: tuple[str, ...]) -> Iterator[tuple[Any, Any, tuple[str, ...], str]]:
    """Yield the texts with references: the table or list that holds each, its name there, path and text."""
    for name, value in table.items() if isinstance(table, dict) else enumerate(table):
        if isinstance(value, str):
            if "${" in value:
                yield table, name, (*path, str(name)), value
        elif isinstance(value, dict | list):
            yield from _texts(value, (*path, str(name)))


def _value(values: dict[str, Any], text: str, path: tuple[str, ...], left: int) -> Any:
    """Return what a text with references stands for; a text that is one reference alone, of any type."""
    if not left:
        raise ConfigError(f"{'.'.join(path)}: {text} refers to itself; write a value")
    if whole := REFERENCE.fullmatch(text):
        return _target(values, whole, path, left)
    return REFERENCE.sub(lambda match: str(_target(values, match, path, left)), text)


def _target(values: dict[str, Any], match: re.Match[str], path: tuple[str, ...], left: int) -> Any:
    dots, name = match.groups()
    at = (*path[: len(path) - len(dots)], *name.split(".")) if dots else tuple(name.split("."))
    target: Any = values
    for part in at:
        if not isinstance(target, dict) or part not in target:
            raise ConfigError(f"{'.'.join(path)}: {match[0]} refers to {'.'.join(at)}, which is no key")
        target = target[part]
    return _value(values, target, at, left - 1) if isinstance(target, str) and "${" in target else target
