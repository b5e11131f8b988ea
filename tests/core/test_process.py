import os
import platform
import subprocess
import sys

import pytest

from texgs.core.memory import POLICY, STATUS, waiting

PROGRAM = """
import os
from texgs.core.memory import waiting
os.environ.update(waiting())
import torch
"""


def test_the_user_decides(monkeypatch):
    for name in POLICY:
        monkeypatch.delenv(name, raising=False)
    assert waiting() == POLICY
    monkeypatch.setenv("OMP_WAIT_POLICY", "active")
    assert waiting() == {"OMP_WAIT_POLICY": "active"}
    monkeypatch.setenv("GOMP_SPINCOUNT", "7")
    assert waiting() == {"OMP_WAIT_POLICY": "active", "GOMP_SPINCOUNT": "7"}


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere torch has another OpenMP")
def test_torch_hears_of_it():
    environment = {name: value for name, value in os.environ.items() if name not in POLICY}
    environment["OMP_DISPLAY_ENV"] = "verbose"
    run = subprocess.run([sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert "OMP_WAIT_POLICY = 'PASSIVE'" in run.stderr
    assert "GOMP_SPINCOUNT = '1000'" in run.stderr


@pytest.mark.skipif(not STATUS.exists(), reason="page faults are counted on Linux")
def test_memory_that_was_freed_is_used_again_without_page_faults():
    code = """
import resource
import numpy as np
from texgs.core.memory import keep_freed_memory
if KEEP and not keep_freed_memory():
    print(-1)
else:
    for size in [20_000_000] * 20 + [160_000_000] * 4:
        np.ones(size // 8), np.ones(size // 8)
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


def test_what_is_in_a_cycle_goes_before_the_libraries_that_it_is_of(tmp_path):
    """HDF5 crashes at its end where a property list of a virtual data set is still there."""
    code = """
import h5py
from texgs.core.memory import collect_rarely
collect_rarely()
layout = h5py.VirtualLayout((4,), "u2")
layout[:] = h5py.VirtualSource("part.h5", "data", (4,))
class Node: pass
node = Node()
node.itself = node
with h5py.File("all.h5", "w") as file:
    file.create_virtual_dataset("data", layout)
with h5py.File("all.h5") as file:
    node.properties = file["data"].id.get_create_plist()
del node
print("done")
"""
    run = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True)
    assert (run.stdout, run.returncode) == ("done\n", 0)
