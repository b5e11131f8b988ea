"""Plain values of a message, each required to be what it should."""

from __future__ import annotations

import json
from typing import Any, NoReturn

from texgs.core.errors import ArgumentError
from texgs.core.numbers import is_number


def parse_json(text: str) -> Any:
    """Plain values.

    Raises:
        ArgumentError: if it is no JSON.
    """

    def no_number(name: str) -> NoReturn:
        raise ValueError(f"{name} is no number of JSON")

    try:
        return json.loads(text, parse_constant=no_number)
    except (ValueError, RecursionError) as error:
        raise ArgumentError(f"message: expected JSON, got {text[:100]!r} ({error})") from error


def number(where: str, value: object, least: float, most: float) -> float:
    """A number of a range.

    Raises:
        ArgumentError: if it is none.
    """
    if not is_number(value) or not least <= value <= most:  # type: ignore[operator]
        raise ArgumentError(f"{where}: expected a number from {least:g} to {most:g}, got {value!r:.100}")
    return float(value)  # type: ignore[arg-type]


def whole(where: str, value: object, least: int, most: int) -> int:
    """A whole number of a range.

    Raises:
        ArgumentError: if it is none.
    """
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
        raise ArgumentError(f"{where}: expected a whole number from {least} to {most}, got {value!r:.100}")
    return value


def flag(where: str, value: object) -> bool:
    """True or false.

    Raises:
        ArgumentError: if it is neither.
    """
    if not isinstance(value, bool):
        raise ArgumentError(f"{where}: expected true or false, got {value!r:.100}")
    return value


def words(where: str, value: object) -> str:
    """A text.

    Raises:
        ArgumentError: if it is none.
    """
    if not isinstance(value, str):
        raise ArgumentError(f"{where}: expected a text, got {value!r:.100}")
    return value
