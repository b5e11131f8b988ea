import subprocess
import sys

import numpy as np


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
