import platform
import subprocess
import sys

import numpy as np
import pytest

from texgs.core.memory import STATUS


def test_an_array_counts():
    """In a process of its own: that of the tests has had gigabytes, above which an array has to be."""
    code = """
import numpy as np
from texgs.core.memory import peak_memory
before = peak_memory()
held = np.ones(100_000_000 // 8 + before // 8)
assert peak_memory() >= before + 90e6
del held
assert peak_memory() >= before + 90e6, "a peak does not fall"
"""
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_child_does_not_inherit_the_peak_of_its_parent():
    held = np.ones(60_000_000)
    code = "from texgs.core.memory import peak_memory; print(peak_memory())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert int(done.stdout) < held.nbytes / 2


@pytest.mark.skipif(not STATUS.exists(), reason="page faults are counted on Linux")
def test_memory_that_was_freed_is_used_again_without_page_faults():
    code = """
import resource
import numpy as np
from texgs.core.memory import keep_freed_memory
if KEEP and not keep_freed_memory():
    print(-1)
else:
    for _ in range(50):
        np.ones(20_000_000 // 8), np.ones(20_000_000 // 8)
    print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt)
"""
    faults = []
    for keep in ("True", "False"):
        words = [sys.executable, "-c", code.replace("KEEP", keep)]
        faults.append(int(subprocess.run(words, capture_output=True, text=True, check=True).stdout))
    if faults[0] < 0:
        assert platform.libc_ver()[0] != "glibc"
        pytest.skip("the C library is not glibc")
    assert faults[0] < 0.5 * faults[1]
