"""What a process asks of its machine: threads that wait, memory, and Ctrl-C where it breaks nothing."""

import os
import platform
import re
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import torch

from tests.refusals import refused
from texgs.core import memory
from texgs.core.errors import OutOfMemoryError
from texgs.core.io import reading_as
from texgs.core.memory import POLICY, STATUS, waiting
from texgs.core.progress import interrupts_between_items, progress

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


def test_an_array_counts_and_a_child_does_not_inherit_the_peak_of_its_parent():
    """In a process of its own: that of the tests has had gigabytes, above which an array has to be."""
    code = """
import numpy as np
from texgs.core.memory import peak_memory
before = peak_memory()
held = np.ones(100_000_000 // 8 + before // 8)
assert peak_memory() >= before + 90e6
del held
assert peak_memory() >= before + 90e6, "a peak does not fall"
print(before)
"""
    held = np.ones(60_000_000)
    done = subprocess.run([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, check=True)
    assert int(done.stdout) < held.nbytes / 2


def test_memory_that_is_not_there_says_how_much_was_wanted():
    with (
        pytest.raises(OutOfMemoryError, match=r"a thing needs more memory .*512\. PiB"),
        reading_as("a thing"),
    ):
        np.empty(2**56)
    wanted = r"more memory .*\(512\. PiB wanted at once, .* GiB are free\)"
    with pytest.raises(OutOfMemoryError, match=wanted), memory.as_out_of_memory():
        np.empty(2**56)
    with pytest.raises(OutOfMemoryError, match=r"\(\d+ bytes wanted at once"), memory.as_out_of_memory():
        torch.empty(2**55)
    refused(lambda: memory.require_memory(2**60, "f", "go"), "f: .*GiB are free; go", OutOfMemoryError)


@pytest.fixture
def group(tmp_path, monkeypatch):
    """Write the limit, the use and the kinds of memory of a group of processes that this one is in."""
    monkeypatch.setattr(memory, "CGROUP", tmp_path)
    monkeypatch.setattr(memory, "GROUP", tmp_path / "own")
    (tmp_path / "own").write_text("0::/slurm/job_7\n")

    def write(folder, most, used, kinds="inactive_file 0", names=("memory.max", "memory.current")):
        (tmp_path / folder).mkdir(parents=True, exist_ok=True)
        for name, value in zip((*names, "memory.stat"), (most, used, kinds), strict=True):
            (tmp_path / folder / name).write_text(f"{value}\n")

    return write


def test_a_container_has_what_it_may_have_and_what_files_give_back(group):
    group("", 1_000_000, 900_000, "anon 1\nfile 9\ninactive_file 300000\nactive_file 50000")
    assert memory.free_memory() == 450_000
    group("", "max", 900_000)
    assert memory.free_memory() > 1e6


def test_a_group_inside_of_others_has_what_the_tightest_leaves(group):
    """As the jobs of a cluster are in."""
    group("slurm/job_7", 500_000, 100_000)
    group("slurm", 300_000, 100_000)
    assert memory.free_memory() == 200_000
    group("slurm", "max", 100_000)
    assert memory.free_memory() == 400_000


def test_a_group_of_the_first_version_counts(group):
    memory.GROUP.write_text("12:pids:/a\n4:cpu,memory:/slurm/job_7\n1:name=systemd:/b\n")
    kinds = "cache 9\ninactive_file 100000\ntotal_inactive_file 100000"
    names = ("memory.limit_in_bytes", "memory.usage_in_bytes")
    group("memory/slurm/job_7", 500_000, 300_000, kinds, names)
    assert memory.free_memory() == 300_000


@pytest.mark.skipif(sys.platform != "linux", reason="what counts is told by Linux")
def test_a_limit_of_the_process_counts():
    import resource

    before = resource.getrlimit(resource.RLIMIT_DATA)
    used = 1024 * int(re.search(r"VmData:\s+(\d+)", memory.STATUS.read_text())[1])
    resource.setrlimit(resource.RLIMIT_DATA, (used + (1 << 30), before[1]))
    try:
        assert 0 < memory.free_memory() <= 1 << 30
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, before)


def ctrl_c():
    signal.raise_signal(signal.SIGINT)


@pytest.fixture(autouse=True)
def _handler_stays():
    """That of Python, which has none where SIGINT is ignored, as in a job started in the background."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    assert signal.signal(signal.SIGINT, before) is signal.default_int_handler


def a_loop(done):
    for item in progress(range(9), title="loop", unit="item"):
        if item == 3:
            ctrl_c()
        done.append(item)


def no_loop(done):
    ctrl_c()
    done.append("end")


def twice(done):
    ctrl_c()
    done.append("first")
    ctrl_c()
    done.append("second")


@pytest.mark.parametrize(
    ("work", "expected"), [(a_loop, [0, 1, 2, 3]), (no_loop, ["end"]), (twice, ["first"])]
)
def test_it_comes_at_the_next_item_at_the_end_or_the_second_time_at_once(work, expected):
    done = []
    with pytest.raises(KeyboardInterrupt), interrupts_between_items():
        work(done)
    assert done == expected


def test_packages_are_imported_as_a_whole(tmp_path, monkeypatch):
    """Else the package is gone, but not its module that was there, which nothing binds to the new one."""
    package = tmp_path / "halved"
    package.mkdir()
    again = "import halved.part\nimport signal\nsignal.raise_signal(signal.SIGINT)\nwhole = halved.part.one\n"
    (package / "__init__.py").write_text(again)
    (package / "part.py").write_text("one = 1\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(KeyboardInterrupt), interrupts_between_items():
        import halved
    assert sys.modules["halved"].whole == 1
    assert halved.part.one == 1


def test_what_goes_wrong_is_told_and_other_threads_are_left_alone():
    with pytest.raises(ValueError, match="wrong"), interrupts_between_items():
        raise ValueError("wrong")
    work = interrupts_between_items()(lambda: signal.getsignal(signal.SIGINT))
    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(work).result() == signal.getsignal(signal.SIGINT)
