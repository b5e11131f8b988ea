"""How much memory this process has needed, and what happens to what it no longer needs."""

import ctypes
import os
import re
import sys
from pathlib import Path

STATUS = Path("/proc/self/status")
GLIBC_OPTIONS = {-1: 1 << 30, -3: 32 << 20}  # M_TRIM_THRESHOLD; M_MMAP_THRESHOLD, the most it takes


def peak_memory() -> int:
    """Most bytes of memory that this process had resident so far.

    Linux tells it for the program that runs; elsewhere the peak may be that of the process that started it.
    """
    if STATUS.exists():
        found = re.search(r"VmHWM:\s+(\d+) kB", STATUS.read_text())
        if found:
            return 1024 * int(found[1])
    import resource  # not on Windows

    unit = 1 if sys.platform == "darwin" else 1024
    return unit * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def keep_freed_memory() -> bool:
    """Let the C library keep what this process frees for its next request, instead of handing it back.

    A training step asks for the same images again and again; pages that were handed back are zeroed by the
    kernel each time, which takes as long as rendering. For programs, not for libraries to call: it holds for
    the whole process.

    Returns:
        Whether it does; only glibc can be told.
    """
    os.environ.setdefault("THP_MEM_ALLOC_ENABLE", "1")  # torch: large pages, where it was not used before
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):
        return False
    return all(mallopt(option, size) for option, size in GLIBC_OPTIONS.items())
