"""Colours as a user gives them: numbers, hexadecimal text, or names of CSS."""

from texgs.core.errors import ArgumentError
from texgs.core.names import close, is_number

Color = tuple[float, float, float]  # red, green, blue in [0, 1]


def color(name: str, value: object) -> Color:
    """Return red, green, blue of three numbers, "#ffd27f" or a name of CSS; errors begin with `name`."""
    given = channels(value) if isinstance(value, str) else value
    numbers = given if isinstance(given, list | tuple) else ()
    if len(numbers) != 3 or not all(is_number(x) and 0 <= x <= 1 for x in numbers):
        from PIL import ImageColor

        hint = close(value, ImageColor.colormap) if isinstance(value, str) else ""
        expected = "three numbers from 0 to 1, #rrggbb or the name of a colour"
        raise ArgumentError(f"{name}: expected {expected}, got {value!r:.100}{hint}")
    red, green, blue = (float(x) for x in numbers)
    return red, green, blue


def channels(text: str) -> tuple[float, ...]:
    """Return the channels in [0, 1] of a name of CSS, or of hexadecimal text; none of any other text."""
    from PIL import ImageColor

    if text.lower() not in ImageColor.colormap and not text.startswith("#"):
        return ()
    try:
        return tuple(each / 255 for each in ImageColor.getrgb(text))
    except ValueError:
        return ()
