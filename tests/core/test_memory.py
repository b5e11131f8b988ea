import re
import subprocess
import sys

import numpy as np
import pytest
import torch

from tests.refusals import refused
from texgs.core import memory
from texgs.core.errors import OutOfMemoryError
from texgs.core.io import reading_as


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
