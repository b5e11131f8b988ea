"""The border to files: none is seen half written, and whatever a reader raises becomes one sentence."""

import errno
import json
import os
import re
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from shutil import copyfileobj
from stat import S_ISDIR, S_ISFIFO, S_ISREG
from typing import Any, BinaryIO

from texgs.core.errors import ArgumentError, OutOfMemoryError, TexgsError
from texgs.core.memory import is_out_of_memory

ADVICE = "is the file damaged or cut off?"
SCRATCH = re.compile(r"\..+\.[0-9a-z_]{8}")  # files beside a target, until they are whole


def write_atomic(path: str | Path, write: Callable[[BinaryIO], object]) -> Path:
    """Create or replace a file in one step and return its path; folders on the way are created.

    `write` gets a binary file opened for writing. If it raises, the target is left as it was.
    """
    path = Path(path)
    if is_there(path) and not path.is_file() and not path.is_dir():  # it would be replaced by a file
        raise ArgumentError(f"{path}: expected the name of a file, got a device or a named pipe")
    scratch = path.parent / f".{path.name}.{secrets.token_hex(4)}"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = scratch.open("xb")
    except OSError as error:
        raise ArgumentError(
            f"{path}: cannot write there ({error.strerror}); choose another folder"
        ) from error
    try:
        with file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
        scratch.replace(path)
    except BaseException as error:
        scratch.unlink(missing_ok=True)
        if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
            raise ArgumentError(f"{path}: no space left there; free some or choose another folder") from error
        if path.is_dir():
            raise ArgumentError(f"{path}: expected the name of a file, got a folder; add a name") from error
        raise
    return path


def require_place(path: Path) -> None:
    """Require a place where `write_atomic` can write a file, before the work for it."""
    folder = next(each for each in path.absolute().parents if is_there(each))
    if not folder.is_dir() or not os.access(folder, os.W_OK | os.X_OK):
        reason = os.strerror(errno.EACCES if folder.is_dir() else errno.ENOTDIR)
        raise ArgumentError(f"{path}: cannot write there ({reason}); choose another folder")


def copy_atomic(source: Path, target: Path) -> None:
    """Copy a file, replacing the target in one step."""
    with source.open("rb") as file:
        write_atomic(target, partial(copyfileobj, file))


def remove_scratch(folder: Path) -> None:
    """Remove what processes that were killed inside `write_atomic` have left in a folder and those below it.

    Only for a folder that no other process writes to.
    """
    for path in folder.rglob(".*"):
        if SCRATCH.fullmatch(path.name) and path.is_file():
            path.unlink(missing_ok=True)


def write_bytes(path: str | Path, data: bytes) -> Path:
    """Create or replace a file with `data` in one step; see `write_atomic`."""
    return write_atomic(path, lambda file: file.write(data))


def write_json(path: str | Path, value: Any) -> Path:
    """Create or replace a JSON file in one step: indented, keys in the order given, without NaN."""
    try:
        text = json.dumps(value, indent=2, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise ArgumentError(f"{path}: cannot be written as JSON: {error}") from error
    return write_bytes(path, text.encode() + b"\n")


def read_json(path: str | Path) -> Any:
    """Return the contents of a JSON file."""
    with reading(path, "JSON") as path:
        return json.loads(path.read_text(encoding="utf-8"))


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
    """Return whether there is a file or a folder of this name; it is an error where that cannot be told."""
    try:
        return Path(path).exists()
    except OSError as error:
        raise ArgumentError(f"{path}: cannot be read ({error.strerror})") from error


@contextmanager
def reading(path: str | Path, what: str, advice: str = ADVICE) -> Iterator[Path]:
    """Require a regular file, and report whatever a reader raises over it as one sentence.

    This says what the file should be, such as "a PLY file", and what to do about one that is something else.
    It is an ArgumentError, or an OutOfMemoryError; errors of this project pass.
    """
    path = require_file(path, what)
    with reading_as(what, advice, f"{path}: "):
        yield path


@contextmanager
def reading_as(what: str, advice: str = ADVICE, where: str = "") -> Iterator[None]:
    """Do as `reading` for a part of a file, or where the border around it names the file.

    Readers of foreign formats raise what they happen to trip over in a damaged file, of any class.
    """
    try:
        yield
    except TexgsError:
        raise
    except Exception as error:
        if isinstance(error, OSError) and error.errno is not None:  # without: a library's, about the contents
            raise ArgumentError(f"{where}cannot be read ({error.strerror})") from error
        if is_out_of_memory(error):
            raise OutOfMemoryError(
                f"{where}{what} needs more memory than there is ({reason(error)}); {advice}"
            ) from error
        if isinstance(error, ImportError):
            raise ArgumentError(
                f"{where}expected {what} and the Python packages that read it, got {reason(error)}; "
                + ("install them again" if advice == ADVICE else advice)
            ) from error
        raise ArgumentError(f"{where}expected {what}, got {reason(error)}; {advice}") from error


def reason(error: Exception) -> str:
    """Return what an error of a library says, in one line."""
    if isinstance(error, RecursionError):
        return "what is nested too deeply"
    if isinstance(error, KeyError):
        return f"a header without {error}"
    return " ".join(str(error).split()) or type(error).__name__
