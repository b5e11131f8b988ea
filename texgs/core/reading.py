"""The border to files that others have made: whatever a library raises over one becomes one sentence."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from stat import S_ISDIR, S_ISFIFO, S_ISREG

from texgs.core.errors import ArgumentError, OutOfMemoryError, TexgsError
from texgs.core.memory import is_out_of_memory

ADVICE = "is the file damaged or cut off?"


def require_file(path: str | Path, what: str = "a file") -> Path:
    """Require a regular file: a named pipe would be waited for, and a device may never end."""
    path = Path(path)
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError) as error:
        raise ArgumentError(f"{path}: no such file") from error
    except OSError as error:
        raise ArgumentError(f"{path}: cannot be read ({error.strerror})") from error
    except ValueError as error:  # a zero in the name
        raise ArgumentError(f"{path}: expected the name of a file, got {error}") from error
    if not S_ISREG(mode):
        kind = "a folder" if S_ISDIR(mode) else "a named pipe" if S_ISFIFO(mode) else "a device or socket"
        raise ArgumentError(f"{path}: expected {what}, got {kind}; name a file")
    return path


def is_there(path: str | Path) -> bool:
    """Return whether there is a file or a folder of this name.

    Raises:
        ArgumentError: if that cannot be told: others may not look there, or the name is too long.
    """
    try:
        return Path(path).exists()
    except OSError as error:
        raise ArgumentError(f"{path}: cannot be read ({error.strerror})") from error


@contextmanager
def reading(path: str | Path, what: str, advice: str = ADVICE) -> Iterator[Path]:
    """Require a regular file, and report whatever a reader raises over it as one sentence.

    Args:
        path: of the file.
        what: it should be, such as "a PLY file".
        advice: what to do about a file that is something else.

    Raises:
        ArgumentError: in place of the reader's error; this project's own errors pass.
        OutOfMemoryError: in place of a MemoryError.
    """
    path = require_file(path, what)
    with reading_as(what, advice, f"{path}: "):
        yield path


@contextmanager
def reading_as(what: str, advice: str = ADVICE, where: str = "") -> Iterator[None]:
    """As `reading`, for a part of a file, or where the border around it names the file.

    Readers of foreign formats raise what they happen to trip over in a damaged file, of any class.
    """
    try:
        yield
    except TexgsError:
        raise
    except OSError as error:
        if error.errno is None:  # of a library, about the contents
            raise ArgumentError(f"{where}expected {what}, got {reason(error)}; {advice}") from error
        raise ArgumentError(f"{where}cannot be read ({error.strerror})") from error
    except Exception as error:
        if is_out_of_memory(error):
            raise OutOfMemoryError(
                f"{where}{what} needs more memory than there is ({reason(error)}); {advice}"
            ) from error
        raise ArgumentError(f"{where}expected {what}, got {reason(error)}; {advice}") from error


def reason(error: Exception) -> str:
    """Return what an error of a library says, in one line."""
    if isinstance(error, RecursionError):
        return "what is nested too deeply"
    if isinstance(error, KeyError):
        return f"a header without {error}"
    return " ".join(str(error).split()) or type(error).__name__
