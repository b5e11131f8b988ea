"""What this process has of the machine: memory that it needed, may have and gives back; and its threads."""

import atexit
import ctypes
import gc
import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from texgs.core.errors import OutOfMemoryError

STATUS = Path("/proc/self/status")
CGROUP, GROUP = Path("/sys/fs/cgroup"), Path("/proc/self/cgroup")
CONTAINERS = (  # for versions 2 and 1 of cgroups: the line that names a group, its root, limit and use
    (r"^0::/(.*)$", "", "memory.max", "memory.current"),
    (r"^\d+:(?:.*,)?memory(?:,.*)?:/(.*)$", "memory", "memory.limit_in_bytes", "memory.usage_in_bytes"),
)
MIB, GIB = 1 << 20, 1 << 30
SMALL_BYTES = 64 << 20  # bytes that need no question
# How threads wait. A fit has thousands of loops a second of less than a millisecond. To wake a thread
# that sleeps takes as long as many of them, above all on virtual machines; one that spins on takes a core
# from others. So they spin for some tens of microseconds and then sleep. docs/accuracy.md has the gain.
POLICY = {
    "OMP_WAIT_POLICY": "passive",  # of every OpenMP: sleep
    "GOMP_SPINCOUNT": "1000",  # of GCC's, which torch has on Linux: look so often before that
}
NEW_OBJECTS = 50_000  # objects made before the garbage collector looks at them
GLIBC_OPTIONS = {-1: 1 << 30, -4: 0}  # M_TRIM_THRESHOLD; M_MMAP_MAX: map no block by itself


def peak_memory() -> int:
    """Return the most bytes of memory that this process had resident so far.

    Linux tells it for the program that runs; elsewhere the peak may be that of the process that started it.
    """
    if STATUS.exists() and (peak := re.search(r"VmHWM:\s+(\d+) kB", STATUS.read_text())):
        return 1024 * int(peak[1])
    if sys.platform == "win32":
        import psutil

        return int(psutil.Process().memory_info().peak_wset)
    import resource

    unit = 1 if sys.platform == "darwin" else 1024
    return unit * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def free_memory() -> int:
    """Return the bytes that this process may still have, by the machine, its container and its own limits."""
    import psutil

    limits = [int(psutil.virtual_memory().available), *container_limits()]
    if sys.platform == "linux":
        import resource

        used_by_kind = dict(re.findall(r"(VmSize|VmData):\s+(\d+) kB", STATUS.read_text()))
        for kind, name in ((resource.RLIMIT_AS, "VmSize"), (resource.RLIMIT_DATA, "VmData")):
            limit = resource.getrlimit(kind)[0]
            if limit != resource.RLIM_INFINITY:
                limits.append(limit - 1024 * int(used_by_kind[name]))
    return max(0, min(limits))


def room_for_volume() -> int:
    """Return the bytes that a volume may take, of which rays need all samples: half of what is free."""
    return free_memory() // 2


def container_limits() -> Iterator[int]:
    """Yield bytes that are left in each of the groups that this process is in, one inside of the other."""
    try:
        groups = GROUP.read_text()
    except OSError:  # no Linux
        return
    for line, root, *names in CONTAINERS:
        own = re.search(line, groups, re.MULTILINE)
        group = CGROUP / root / (own[1] if own else "")
        for folder in (group, *group.parents):
            try:
                most, used, kinds = ((folder / name).read_text() for name in (*names, "memory.stat"))
                cached = re.findall(r"^(?:in)?active_file (\d+)", kinds, re.MULTILINE)  # given back on demand
                yield int(most) - int(used) + sum(map(int, cached))
            except (OSError, ValueError):  # no such group, or one without a limit: "max"
                pass
            if folder == CGROUP:
                break


def require_memory(n_bytes: int, what: str, advice: str) -> None:
    """Require that so many bytes can be had, before they are asked for; else advise what to do without.

    Linux hands out more memory than there is, and ends a process that uses it.
    """
    if n_bytes <= SMALL_BYTES:
        return
    free = free_memory()
    if n_bytes > free:
        raise OutOfMemoryError(
            f"{what}: needs {_gib(n_bytes)} GiB of memory, but {_gib(free)} GiB are free; {advice}"
        )


def _gib(n_bytes: int) -> str:
    """Return a number of bytes in GiB, to three digits or a whole number."""
    return f"{n_bytes / GIB:.3g}" if n_bytes < 1000 * GIB else f"{n_bytes / GIB:.0f}"


@contextmanager
def as_out_of_memory() -> Iterator[None]:
    """Turn what Python, NumPy or torch raise where memory ends into one sentence with what was wanted."""
    try:
        yield
    except OutOfMemoryError:
        raise
    except (MemoryError, RuntimeError) as error:
        if not is_out_of_memory(error):
            raise
        wanted = re.search(r"[\d.]+ ?(bytes|[KMGTPE]iB)", str(error))
        raise OutOfMemoryError(
            f"the work needs more memory than there is ({wanted[0] if wanted else 'unknown'} wanted at once, "
            f"{free_memory() / GIB:.3g} GiB are free); choose smaller images, fewer views or another machine"
        ) from error


def is_out_of_memory(error: BaseException) -> bool:
    """Return whether an error says that memory could not be had, of Python, NumPy, or torch on any device."""
    return (
        isinstance(error, MemoryError)
        or type(error).__name__ == "OutOfMemoryError"
        or (isinstance(error, RuntimeError) and "can't allocate memory" in str(error))
    )


def waiting() -> dict[str, str]:
    """Return environment variables that OpenMP reads as torch is imported; what the user has set stays."""
    own = {name: os.environ[name] for name in POLICY if name in os.environ}
    return own or dict(POLICY)


def collect_rarely() -> None:
    """Let the garbage collector look only where many objects are new, and once at the end of this process.

    Large libraries make millions of objects that stay. By default the collector goes through them again and
    again during imports, and more than once at the end: a third of the time of a short command. For programs,
    not for libraries to call.
    """
    gc.set_threshold(NEW_OBJECTS)
    atexit.register(gc.freeze)
    atexit.register(gc.collect)  # before that: HDF5 crashes where it has to close what is in a cycle itself


def keep_freed_memory() -> bool:
    """Let the C library keep what this process frees for its next request, instead of handing it back.

    A training step asks for the same images again and again; pages that were handed back are zeroed by the
    kernel each time, which takes as long as rendering. For programs, not for libraries to call: it holds for
    the whole process. Return whether it does; only glibc can be told.
    """
    os.environ.setdefault("THP_MEM_ALLOC_ENABLE", "1")  # torch: large pages, where it was not used before
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):
        return False
    return all(mallopt(option, size) for option, size in GLIBC_OPTIONS.items())
