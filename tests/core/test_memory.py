import subprocess
import sys

import numpy as np

from texgs.core.memory import peak_memory


def test_an_array_counts():
    before = peak_memory()
    held = np.ones(100_000_000 // 8 + max(0, before) // 8)
    assert peak_memory() >= before + 90e6
    del held
    assert peak_memory() >= before + 90e6, "a peak does not fall"


def test_a_child_does_not_inherit_the_peak_of_its_parent():
    held = np.ones(60_000_000)
    code = "from texgs.core.memory import peak_memory; print(peak_memory())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert int(done.stdout) < held.nbytes / 2
