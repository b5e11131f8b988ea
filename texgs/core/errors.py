"""Errors a user can do something about. Each message is one sentence: what, where, got, what to do."""


class TexgsError(Exception):
    """A user's mistake or a limit of the machine; the command line prints it without a traceback."""


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
    """A key of the configuration is unknown, or its value is not one that is possible."""


class MissingDataError(ConfigError):
    """A data set's files are not on this machine; the message says how to get them."""


class FitError(TexgsError, ArithmeticError):
    """A fit cannot go on."""


def first_line(error: Exception) -> str:
    """Enough of an error to recognise it, on one line."""
    lines = str(error).strip().splitlines()
    text = lines[0] if lines else type(error).__name__
    return text if len(text) <= 120 else f"{text[:120]}..."
