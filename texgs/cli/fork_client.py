"""Run `texgs` with the words of this command line, and end as it ends: python -PSE fork_client.py WORD ...

Where a run has a fork server, that forks for it; else this process becomes it. It is started as a file and
imports nothing but a few modules of the standard library, because each job waits for it.
"""

import os
import sys


def forked(name: str, words: list[str]) -> int | None:
    """Exit code of the job that the server of this name has run; None where there is no server."""
    import json
    import signal
    import socket

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the job hears of it itself, and ends
    request = {
        "arguments": words,
        "folder": os.getcwd(),  # noqa: PTH109 - pathlib takes longer than all else here
        "environment": dict(os.environ),
    }
    body = json.dumps(request).encode()
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as server:
        try:
            server.connect(f"\0{name}")
            socket.send_fds(server, [len(body).to_bytes(4, "big")], [0, 1, 2])
            server.sendall(body)
        except OSError:
            signal.signal(signal.SIGINT, signal.default_int_handler)
            return None
        try:
            code = server.recv(1)
        except OSError:
            code = b""
    if not code:
        print(
            "texgs: the process of this job crashed or was killed, as when memory runs out", file=sys.stderr
        )
    return code[0] if code else 1


if __name__ == "__main__":
    name = os.environ.get("TEXGS_FORK_SERVER")
    code = forked(name, sys.argv[1:]) if name else None
    if code is None:
        os.execv(sys.executable, [sys.executable, "-P", "-m", "texgs.cli.main", *sys.argv[1:]])
    sys.exit(code)
