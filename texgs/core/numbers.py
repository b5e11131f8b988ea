"""What counts as a number in files and settings."""

from math import isfinite

LARGEST = 10**300  # there are whole numbers that no float can hold


def is_number(value: object) -> bool:
    """Whether it is a finite number; true and false are none."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= LARGEST and isfinite(value)
