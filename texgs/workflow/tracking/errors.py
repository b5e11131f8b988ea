"""What goes wrong with a tracking store, in one sentence and without passwords."""

import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from texgs.core.errors import TexgsError

LONGEST_REASON = 200


class TrackingError(TexgsError, RuntimeError):
    """The tracking store cannot be used."""


@contextmanager
def translated(uri: str) -> Iterator[None]:
    """Turn whatever MLflow raises into one TrackingError that names the store."""
    outer = sys.exception()
    try:
        yield
    except TexgsError:
        raise
    except Exception as error:  # the client passes on what any of the libraries below it raises
        raise TrackingError(
            f"{public(uri)}: the tracking store cannot be used ({cause(error, outer)}); "
            "check it, or switch tracking off"
        ) from error


def public(text: str) -> str:
    """The text without the user name and password of an address in it."""
    return re.sub(r"//[^/@\s]*@", "//", text)


def cause(error: BaseException, outer: BaseException | None) -> str:
    """What lies at the bottom of an error of MLflow, such as "Connection refused".

    `outer` is what was being handled when MLflow was called: the job's own error is no cause.
    """
    while (deeper := error.__cause__ or error.__context__) and deeper is not outer:
        error = deeper
    return reason(error)


def reason(error: BaseException) -> str:
    """The first line of an error's message, shortened, or its type where there is none."""
    line = next(iter(str(error).splitlines()), "").strip()
    return public(line)[:LONGEST_REASON] or type(error).__name__
