"""A process that imports the heavy libraries once and forks for every job of a run.

Importing torch and MLflow takes 6 CPU seconds, more than many a job. A forked job is the process of a job in
all else: its own memory, threads, working directory, environment and exit code. It belongs to the process
group of the run, so that Ctrl-C and a kill of the group reach it. Linux only: elsewhere a fork of a process
with such libraries is not safe, and jobs start as programs do.
"""

from __future__ import annotations

import atexit
import contextlib
import gc
import importlib
import json
import os
import secrets
import selectors
import signal
import socket
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from texgs.cli.main import main as texgs
from texgs.core.memory import collect_rarely

ADDRESS = "TEXGS_FORK_SERVER"  # environment variable: the server's name among the abstract sockets
LIBRARIES = (
    "torch._dynamo",  # which optimisers import
    "hydra",
    "kornia",
    "matplotlib.backends.backend_agg",
    "matplotlib.figure",
    "PIL.Image",
    "scipy.spatial",
)
TRACKING = ("mlflow", "mlflow.store.tracking.sqlalchemy_store")
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1"}  # a pool of threads would not outlive a fork


@dataclass(frozen=True)
class Request:
    """What a job is started with."""

    arguments: list[str]  # words after `texgs`
    folder: str  # working directory
    environment: dict[str, str]
    files: tuple[int, ...]  # standard input, output and error


@dataclass(frozen=True)
class Running:
    """A job and whoever waits for its exit code."""

    process: int
    descriptor: int  # of the process; readable when it has ended
    client: socket.socket  # readable when the client has gone


def start(environment: Mapping[str, str]) -> subprocess.Popen[bytes] | None:
    """Start a server for the jobs of this process, and tell them its name by the environment.

    It ends after this process has, when its last job has ended.

    Args:
        environment: what jobs have in theirs besides the environment of this process.

    Returns:
        The server, to be kept as long as jobs may come; None where there is no such thing.
    """
    if sys.platform != "linux":
        return None
    name = f"texgs-{os.getpid()}-{secrets.token_hex(8)}"
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as listener:
        listener.bind(f"\0{name}")
        listener.listen(128)
        words = [str(listener.fileno()), *LIBRARIES, *(TRACKING if "TEXGS_TRACKING" in environment else ())]
        server = subprocess.Popen(
            [sys.executable, "-P", "-m", "texgs.cli.fork_server", *words],
            stdin=subprocess.PIPE,
            pass_fds=[listener.fileno()],
            env={**os.environ, **environment, **ONE_THREAD},
        )
    os.environ[ADDRESS] = name
    return server


class Server:
    """The loop of the server."""

    def __init__(self, listener: socket.socket, run: int) -> None:
        """Serve requests that come to a socket until the other end of the pipe `run` is closed."""
        self._events = selectors.DefaultSelector()
        self._listener, self._run = listener, run
        self._jobs: list[Running] = []
        for source, call in ((listener, self._begin), (run, self._close)):
            self._events.register(source, selectors.EVENT_READ, call)

    def serve(self) -> Request | None:
        """Fork for every request.

        Returns:
            In each forked process its request; in the server None, when the run and all jobs have ended.
        """
        while self._events.get_map():
            key, _ = self._events.select()[0]  # one at a time: an event may close what others are about
            request: Request | None = key.data()
            if request is not None:
                return request
        return None

    def _begin(self) -> Request | None:
        client, _ = self._listener.accept()
        request = receive(client)
        if request is None:
            client.close()
            return None
        process = os.fork()
        if process == 0:
            self._leave(client)
            return request
        for file in request.files:
            os.close(file)
        job = Running(process, os.pidfd_open(process), client)
        self._jobs.append(job)
        self._events.register(job.descriptor, selectors.EVENT_READ, lambda: self._end(job))
        self._events.register(client, selectors.EVENT_READ, lambda: self._stop(job))
        return None

    def _end(self, job: Running) -> None:
        """Tell the client how a job has ended, as a shell would."""
        code = os.waitstatus_to_exitcode(os.waitpid(job.process, 0)[1])
        if job.client in self._events.get_map():
            self._events.unregister(job.client)
            with contextlib.suppress(OSError):  # it may have gone in this moment
                job.client.sendall(bytes([code if code >= 0 else 128 - code]))
        self._events.unregister(job.descriptor)
        os.close(job.descriptor)
        job.client.close()
        self._jobs.remove(job)

    def _stop(self, job: Running) -> None:
        """End a job whose client was killed."""
        self._events.unregister(job.client)
        os.kill(job.process, signal.SIGTERM)

    def _close(self) -> None:
        """Take no more requests."""
        for source in (self._listener, self._run):
            self._events.unregister(source)
        self._listener.close()

    def _leave(self, client: socket.socket) -> None:
        """Close what a forked process has of the server."""
        self._events.close()
        self._listener.close()
        for job in self._jobs:
            os.close(job.descriptor)
            job.client.close()
        client.close()


def receive(client: socket.socket) -> Request | None:
    """The request of a client; None where it is of another user, or has gone before it was complete."""
    peer = client.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12)
    if int.from_bytes(peer[4:8], sys.byteorder) != os.getuid():
        return None
    try:
        length, files, _, _ = socket.recv_fds(client, 4, 3)
        with client.makefile("rb") as stream:
            body: dict[str, Any] = json.loads(stream.read(int.from_bytes(length, "big")))
    except (OSError, ValueError):
        return None
    return Request(body["arguments"], body["folder"], body["environment"], tuple(files))


def become(request: Request) -> None:
    """Give this forked process what its job is started with."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for target, file in enumerate(request.files):
        os.dup2(file, target)
        os.close(file)
    # Those of the server are of other kinds of files, and behave like it.
    sys.stdout = open(1, "w", closefd=False)  # noqa: SIM115
    sys.stderr = open(2, "w", buffering=1, closefd=False)  # noqa: SIM115
    os.chdir(request.folder)
    os.environ.clear()
    os.environ.update(request.environment)
    sys.argv = ["texgs", *request.arguments]
    use_threads(int(os.environ.get("OMP_NUM_THREADS", len(os.sched_getaffinity(0)))))


def use_threads(count: int) -> None:
    """Let the libraries that are loaded work with as many threads; they no longer read the environment."""
    from threadpoolctl import threadpool_limits

    threadpool_limits(count)
    if "torch" in sys.modules:
        sys.modules["torch"].set_num_threads(count)


def main() -> int:
    """Serve, or in a forked process run the job."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # its jobs hear of it themselves
    collect_rarely()
    for library in sys.argv[2:]:
        importlib.import_module(library)
    gc.freeze()  # a collection in a job would copy each page that it looks at
    with socket.socket(fileno=int(sys.argv[1])) as listener:
        request = Server(listener, sys.stdin.fileno()).serve()
    if request is None:
        return 0
    become(request)
    code = texgs()
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    os._exit(code)  # to take apart all that the libraries have made takes longer than many a job


if __name__ == "__main__":
    sys.exit(main())
