"""How the schema declares a key: default, meaning, unit, and the values that are allowed."""

from dataclasses import field
from typing import Any


def key(
    default: Any, help: str, unit: str = "", *, choices: tuple[str, ...] = (), least: float | None = None
) -> Any:
    """A dataclass field that `--help` and the checks can read.

    Args:
        default: a value, a class (one instance each), or a list (a copy each).
        help: what the key means.
        unit: of its numbers.
        choices: the only values allowed, where these are few.
        least: the smallest number allowed.
    """
    metadata = {"help": help, "unit": unit, "choices": choices, "least": least}
    if isinstance(default, type):
        return field(default_factory=default, metadata=metadata)
    if isinstance(default, list):
        return field(default_factory=lambda: list(default), metadata=metadata)
    return field(default=default, metadata=metadata)
