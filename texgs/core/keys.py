"""How the schema declares a key: default, meaning, unit, and the values that are allowed."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from texgs.core.names import is_number

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
