"""How a program of ours uses its process: threads that wait, garbage, and memory that was freed.

A fit has thousands of loops a second that take less than a millisecond. To wake a thread that sleeps takes as
long as many of them, above all on virtual machines; one that spins on takes a core that others need. So they
spin for some tens of microseconds and then sleep. docs/accuracy.md says what that is worth.
"""

import atexit
import ctypes
import gc
import os

POLICY = {
    "OMP_WAIT_POLICY": "passive",  # of every OpenMP: sleep
    "GOMP_SPINCOUNT": "1000",  # of GCC's, which torch has on Linux: look so often before that
}
NEW_OBJECTS = 50_000  # before the garbage collector looks at them
GLIBC_OPTIONS = {-1: 1 << 30, -4: 0}  # M_TRIM_THRESHOLD; M_MMAP_MAX: map no block by itself


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
