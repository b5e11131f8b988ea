"""A process that imports the heavy libraries once and forks for every job of a run.

Importing torch and MLflow takes longer than many a job: forking saves 2 s of each, 4 s of a tracked one. A
forked job is the process of a job in all else: its own memory, threads, working directory, environment and
exit code. It belongs to the process group of the run, so that Ctrl-C and a kill of the group reach it; where
only Snakemake is killed, it goes on. Linux only: elsewhere a fork of a process with such libraries is not
safe, and jobs are programs.
"""

import atexit
import contextlib
import ctypes
import fcntl
import gc
import importlib
import json
import os
import secrets
import select
import signal
import socket
import subprocess
import sys
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NoReturn

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
TRACKING = ("mlflow", "mlflow.store.tracking.sqlalchemy_store", "git")  # which MLflow asks for the commit
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1"}  # a pool of threads would not outlive a fork
PR_SET_PDEATHSIG = 1  # of prctl: the signal that a process gets when its parent ends


@dataclass(frozen=True)
class Request:
    """What a job is started with."""

    arguments: list[str]  # words after `texgs`
    folder: str  # working directory
    environment: dict[str, str]
    files: tuple[int, ...]  # standard input, output and error
    client: socket.socket  # which waits for the exit code


def start(environment: Mapping[str, str]) -> subprocess.Popen[bytes] | None:
    """Start a server for the jobs of this process, and tell them its name by the environment.

    It ends after this process has, when its last job has ended. Jobs have `environment` in theirs besides.
    The server is to be kept as long as jobs may come; None where there is no such thing.
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


def serve(listener: socket.socket, run: int) -> Request | None:
    """Fork for every request that comes to a socket, until the other end of the pipe `run` is closed.

    In each forked process return its request; in the server None, when the run and all jobs have ended.
    """
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # the system forgets jobs that have ended
    server = os.getpid()
    while run not in select.select([listener.fileno(), run], [], [])[0]:
        client, _ = listener.accept()
        if os.fork() == 0:
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            end_with(server, client)
            listener.close()
            os.close(run)
            if request := receive(client):
                return request
            os._exit(1)
        client.close()
    listener.close()
    with contextlib.suppress(ChildProcessError):  # there is none left
        while True:
            os.waitpid(-1, 0)
    return None


def end_with(server: int, client: socket.socket) -> None:
    """Let this process get SIGTERM when the server or the client ends: nobody would hear of its result."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
    fcntl.fcntl(client, fcntl.F_SETOWN, os.getpid())
    fcntl.fcntl(client, fcntl.F_SETSIG, signal.SIGTERM)
    if os.getppid() != server:
        os._exit(1)


def receive(client: socket.socket) -> Request | None:
    """Return the request of a client; None where it is of another user, or goes before its job begins."""
    peer = client.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12)
    if int.from_bytes(peer[4:8], sys.byteorder) != os.getuid():
        return None
    try:
        length, files, _, _ = socket.recv_fds(client, 4, 3)
        with client.makefile("rb") as stream:
            body: dict[str, Any] = json.loads(stream.read(int.from_bytes(length, "big")))
    except (OSError, ValueError):
        return None
    fcntl.fcntl(client, fcntl.F_SETFL, fcntl.fcntl(client, fcntl.F_GETFL) | os.O_ASYNC)
    if select.select([client], [], [], 0)[0]:  # it says no more, unless it has gone
        return None
    return Request(body["arguments"], body["folder"], body["environment"], tuple(files), client)


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


def run(request: Request, call: Callable[[], int]) -> NoReturn:
    """Run the job in this forked process, and tell its client the exit code."""
    become(request)
    try:
        code = call()
    except SystemExit as error:
        code = error.code if isinstance(error.code, int) else int(error.code is not None)
    except BaseException:
        traceback.print_exc()
        code = 1
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    fcntl.fcntl(request.client, fcntl.F_SETFL, 0)  # that the client goes now is right
    with contextlib.suppress(OSError):  # it may have been killed
        request.client.sendall(bytes([code]))
    os._exit(code)  # to take apart all that the libraries have made takes longer than many a job


def main() -> int:
    """Serve, or in a forked process run the job."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # its jobs hear of it themselves
    collect_rarely()
    for library in sys.argv[2:]:
        importlib.import_module(library)
    gc.freeze()  # a collection in a job would copy each page that it looks at
    with socket.socket(fileno=int(sys.argv[1])) as listener:
        request = serve(listener, sys.stdin.fileno())
    if request is not None:
        run(request, texgs)
    return 0


if __name__ == "__main__":
    sys.exit(main())
