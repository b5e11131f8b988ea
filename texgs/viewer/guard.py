"""Who may talk to the server: pages that it served itself, under an address with its token.

A private file leads a browser there: other users see the arguments of a program, but not the file.
"""

import hmac
import ipaddress
import os
import re
import secrets
import socket
from collections.abc import Awaitable, Callable, Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from urllib.parse import urlsplit

from aiohttp import web
from aiohttp.typedefs import Handler, Middleware

from texgs.core.errors import ArgumentError, TexgsError

HOST = re.compile(r"[A-Za-z0-9._:\[\]-]+")
POLICY = (  # for some browsers 'self' does not include the socket
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
    "connect-src 'self' ws://{host}; base-uri 'none'; form-action 'none'"
)
HEADERS = {
    "Cache-Control": "no-store",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}
TOKEN = re.compile(r"/([A-Za-z0-9_-]{43})/")  # 32 random bytes
PAGE = '<!doctype html><meta http-equiv="refresh" content="0; url={0}"><a href="{0}">texgs</a>\n'


def guard(token: str, host: str) -> Middleware:
    """Return a middleware that answers 403 to requests without this token, our host and our origin.

    Errors of handlers become 400 and their sentence.

    The token is the first part of every path, and the host what the server listens on. A site that makes its
    name point to this machine has neither the host nor the origin; a page of another site that opens a socket
    has not the origin.
    """
    names = (host.lower(), socket.gethostname().lower(), socket.getfqdn().lower())  # a resolver may be slow

    @web.middleware
    async def middleware(request: web.Request, handler: Handler) -> web.StreamResponse:
        given = request.path.lstrip("/").partition("/")[0]
        name = request.headers.get("Host", "")
        if not hmac.compare_digest(given.encode("utf-8", "replace"), token.encode()):
            raise web.HTTPForbidden(text="Wrong token: open the address that texgs view printed.")
        if not is_own_host(name, host, names):
            raise web.HTTPForbidden(text="Wrong host: open the address that texgs view printed.")
        is_socket = request.headers.get("Upgrade", "").lower() == "websocket"
        needs_origin = is_socket or request.method != "GET"
        if not is_own_origin(request.headers.get("Origin"), name, needs_origin):
            raise web.HTTPForbidden(text="Wrong origin: open the address that texgs view printed.")
        try:
            return await handler(request)
        except TexgsError as error:
            raise web.HTTPBadRequest(text=str(error)) from error

    return middleware


def headers(is_framed: bool) -> Callable[[web.Request, web.StreamResponse], Awaitable[None]]:
    """Return a handler that adds headers: no browser keeps an answer or takes it for another type.

    Pages may be inside of others, such as notebooks, where they are `is_framed`: the token keeps others out.
    """
    ancestors = "" if is_framed else "; frame-ancestors 'none'"

    async def add_headers(request: web.Request, response: web.StreamResponse) -> None:
        policy = "default-src 'none'"
        if response.status < 400:
            policy = POLICY.format(host=request.headers["Host"]) + ancestors
        response.headers.update({**HEADERS, "Content-Security-Policy": policy})

    return add_headers


def is_own_host(header: str, host: str, names: Collection[str]) -> bool:
    """Return whether a Host header names this machine. The port may be another one, that of a tunnel.

    A server on the loopback interface has its names only. Another one has addresses, which no foreign site
    can have as its name, and `names`: the one that it was given, and the machine's.
    """
    name = None
    with suppress(ValueError):
        name = urlsplit(f"//{header}").hostname if HOST.fullmatch(header) else None
    if name is None:
        return False
    if name == "localhost" or is_loopback(name):
        return True
    if is_loopback(host):
        return False
    return is_address(name) or name in names


def is_own_origin(origin: str | None, header: str, required: bool) -> bool:
    """Return whether a request is from our own page; simple requests of browsers have no origin."""
    if origin is None:
        return not required
    with suppress(ValueError):
        return urlsplit(origin).netloc.lower() == header.lower()
    return False


def is_address(name: str) -> bool:
    """Return whether a name is an IP address."""
    with suppress(ValueError):
        return bool(ipaddress.ip_address(name))
    return False


def is_loopback(name: str) -> bool:
    """Return whether a name is of the loopback interface."""
    return name.lower() == "localhost" or (is_address(name) and ipaddress.ip_address(name).is_loopback)


@contextmanager
def entry(path: Path, root: str) -> Iterator[str]:
    """Yield an address with a token under a root. The file leads there until the block ends.

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
