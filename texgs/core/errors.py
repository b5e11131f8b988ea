"""Errors a user can do something about. Each message is one sentence: what, where, got, what to do."""

import re
from collections.abc import Iterator
from contextlib import contextmanager

MAX_LETTERS = 600  # letters of a message; a damaged file can be quoted at any length
END_LETTERS = 250  # letters kept at the end, where the advice is


class TexgsError(Exception):
    """A user's mistake or a limit of the machine; the command line prints it without a traceback."""

    def __str__(self) -> str:
        """Return the message as a terminal can show it."""
        return printable(super().__str__())


class ShapeError(TexgsError, ValueError):
    """A tensor has the wrong shape."""


class ArgumentError(TexgsError, ValueError):
    """An argument has the wrong type, dtype or value."""


class DeviceError(TexgsError, RuntimeError):
    """Tensors are on different devices, or on one that cannot be used."""


class OutOfMemoryError(TexgsError, MemoryError):
    """The work would need more memory than there is."""


class NativeError(TexgsError, RuntimeError):
    """The native library is missing, does not fit this package or failed."""


class ConfigError(TexgsError, ValueError):
    """A key of the configuration is unknown, or its value is impossible."""


class MissingDataError(ConfigError):
    """A data set's files are not on this machine; the message says how to get them."""


class Stopped(TexgsError):
    """Somebody has stopped the work; nobody has made a mistake."""


class FitError(TexgsError, ArithmeticError):
    """A fit cannot go on."""


@contextmanager
def errors_at(where: object, between: str = ": ") -> Iterator[None]:
    """Prefix the messages of texgs errors with their origin, such as a path."""
    try:
        yield
    except TexgsError as error:
        raise type(error)(f"{where}{between}{error}") from error


def printable(text: str) -> str:
    """Return a text of any origin in one line of bounded length, with control characters written out.

    Names in files can hold sequences that move the cursor, or letters that turn the direction of the text.
    """
    if len(text) > MAX_LETTERS:
        text = f"{text[: MAX_LETTERS - END_LETTERS]} ... {text[-END_LETTERS:]}"
    letters = re.sub(r"\s", " ", text)
    return "".join(x if x.isprintable() else x.encode("unicode_escape").decode() for x in letters)


def first_line(error: Exception) -> str:
    """Return the first line of an error, enough to recognise it."""
    lines = str(error).strip().splitlines()
    text = lines[0] if lines else type(error).__name__
    return text if len(text) <= 120 else f"{text[:120]}..."
