"""Look at a scene and edit it in the browser; Ctrl-C ends it."""

from __future__ import annotations

import argparse
import socket
import sys
import threading
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING

from texgs.cli.options import add_device
from texgs.core.errors import ArgumentError, TexgsError

if TYPE_CHECKING:
    from texgs.viewer.shared_edits import SharedEdits

HOST = "127.0.0.1"
PORT = 8765


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what to show, and where to serve it."""
    parser.add_argument("scene", type=Path, help="scene.yaml, a folder with one, or a model file")
    parser.add_argument(
        "--folder",
        type=Path,
        help="where scenes are saved; default beside the scene, or here for a scene of the workflow",
    )
    parser.add_argument(
        "--styles", type=Path, metavar="FOLDER", help="folder of your own pictures, to choose new looks from"
    )
    parser.add_argument("--port", type=int, help=f"default {PORT}, or another one where it is taken")
    parser.add_argument(
        "--host",
        default=HOST,
        help="to listen on (%(default)s: this machine only); 0.0.0.0 lets others in who know the address",
    )
    parser.add_argument("--no-browser", action="store_true", help="print the address and open nothing")
    add_device(parser)


def run(arguments: argparse.Namespace) -> int:
    """Serve until Ctrl-C."""
    from aiohttp import web

    from texgs.core.cache import cache_folder
    from texgs.core.check import torch_device
    from texgs.viewer.guard import entry, is_loopback
    from texgs.viewer.server import Server
    from texgs.viewer.shared_edits import open_scene

    opened = open_scene(arguments.scene, arguments.folder)
    server = Server(opened, torch_device(arguments.device), arguments.styles)
    listening = listen(arguments.host, arguments.port)
    if not is_loopback(arguments.host):
        sys.stderr.write(
            "Who knows this address and reaches this machine can edit the scene, and nothing is encrypted; "
            "a tunnel (ssh -L) is safer.\n"
        )
    port = listening.getsockname()[1]
    file = cache_folder() / f"viewer-{port}.html"
    with entry(file, f"http://{name_of(arguments.host)}:{port}") as address:
        print(f"{address}\nCtrl-C ends it.", flush=True)
        if not arguments.no_browser:
            threading.Thread(target=webbrowser.open, args=(file.absolute().as_uri(),), daemon=True).start()
        application = server.application(address.split("/")[-2], arguments.host)
        web.run_app(application, sock=listening, print=None, access_log=None, shutdown_timeout=1.0)
    ask_to_save(server.edits)
    return 0


def listen(host: str, port: int | None) -> socket.socket:
    """Return a listening socket, on a free port where none is given and the usual one is taken."""
    if port is not None and not 0 <= port <= 65535:
        raise ArgumentError(f"--port: expected 0 to 65535, got {port}")
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
    except (OSError, UnicodeError) as error:
        raise ArgumentError(f"--host: expected a name or an address of this machine, got {host}") from error
    for choice in (PORT, 0) if port is None else (port,):
        try:
            return socket.create_server((host, choice), family=family)
        except OSError as error:
            reason = error.strerror
    raise ArgumentError(f"--port: cannot listen on port {port} of {host} ({reason}); choose another one")


def name_of(host: str) -> str:
    """Return the name of a host for an address: the machine's, of all interfaces."""
    if host in ("0.0.0.0", "::"):
        return socket.gethostname()
    return f"[{host}]" if ":" in host else host


def ask_to_save(edits: SharedEdits) -> None:
    """Offer to save unsaved edits, or say that they are lost where nobody can answer."""
    if edits.is_saved:
        return
    if not sys.stdin.isatty():
        sys.stderr.write("Edits were not saved.\n")
        return
    name = edits.name
    while name:
        try:
            there = " The file there is replaced." if edits.would_replace(name) else ""
            agreed = answer(f"\nEdits are not saved. Write them to {edits.path_of(name)}?{there} [y/N] ")
            if agreed.lower() in ("y", "yes"):
                print(edits.save(name))
            return
        except TexgsError as error:
            sys.stderr.write(f"{error}\n")
            name = answer("Another name that ends in .yaml, or nothing: ")


def answer(question: str) -> str:
    """Return what the user types; nothing at the end of the input."""
    try:
        return input(question).strip()
    except EOFError:
        return ""
