"""The file that leads a browser to the viewer: other users see arguments of a program, but not the file."""

from __future__ import annotations

import os
import re
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from texgs.core.errors import ArgumentError

TOKEN = re.compile(r"/([A-Za-z0-9_-]{43})/")  # 32 random bytes
PAGE = '<!doctype html><meta http-equiv="refresh" content="0; url={0}"><a href="{0}">texgs</a>\n'


@contextmanager
def entry(path: Path, root: str) -> Iterator[str]:
    """Yield an address under a root, with a new token; meanwhile the file leads there.

    After a run that was killed the token is its token: pages that are still open find this run.
    """
    address = f"{root}/{token_of(path) or secrets.token_urlsafe(32)}/"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.unlink(missing_ok=True)
        with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
            file.write(PAGE.format(address))
    except OSError as error:
        raise ArgumentError(f"{path}: cannot write there ({error.strerror}); set TEXGS_CACHE") from error
    try:
        yield address
    finally:
        path.unlink(missing_ok=True)


def token_of(path: Path) -> str | None:
    """Return the token in such a file; None if others may have read it, or there is none."""
    try:
        is_private = os.name != "posix" or not path.stat().st_mode & 0o077
        address = TOKEN.search(path.read_text(encoding="ascii")) if is_private else None
    except (OSError, UnicodeError):
        return None
    return address[1] if address else None
