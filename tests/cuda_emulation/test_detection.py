"""The emulation of CUDA reports what a GPU would get wrong, whatever the order in which threads run."""

import ctypes
import math

import pytest

from tests.cuda_emulation import emulated

pytestmark = pytest.mark.emulated

SEEDS = range(20)
FAULTS = {
    "barrier missing": "shared memory",  # a race, or nothing written yet
    "barrier missing in loop": "race in shared memory",
    "barrier for some": "not all threads reach a barrier or an exchange: 32 wait at faulty.cu:",
    "different barriers": "threads meet at different barriers",
    "lane mask too small": "an exchange whose mask leaves out the lane that calls it",
    "lanes missing": "not all threads reach a barrier or an exchange",
    "shuffle from nowhere": "a shuffle from a lane that takes no part",
    "atomic missing": "race in global memory",
    "atomic and plain": "race in global memory",
    "neighbour of another block": "race in global memory",
    "shared not written": "shared memory that nothing wrote is read",
    "past the end of shared": "index 64 is past the end of an array at faulty.cu:",
    "past the end of memory": "memory of no allocation is used",
    "memory not written": "device memory that nothing wrote is read",
}


@pytest.fixture(scope="module")
def faulty():
    """The library of faulty kernels."""
    if reason := emulated.missing():
        pytest.skip(reason)
    lib = ctypes.CDLL(str(emulated.build() / "libfaulty.so"))
    emulated.describe(lib)
    lib.run.restype = ctypes.c_bool
    lib.read_too_early.restype = ctypes.c_float
    return lib


def reports(lib, fault, *arguments):
    """What is reported with each seed."""
    messages = []
    for seed in SEEDS:
        lib.emulation_seed(seed)
        assert fault(*arguments) is not False
        report = lib.emulation_synchronize()
        messages.append(report and report.decode())
    return messages


@pytest.mark.parametrize("name", FAULTS)
def test_fault_is_reported_in_every_order(faulty, name):
    for report in reports(faulty, faulty.run, name.encode()):
        assert FAULTS[name] in (report or "nothing")


def test_kernel_without_a_fault(faulty):
    assert reports(faulty, faulty.run, b"right") == [None] * len(SEEDS)


def test_report_names_file_and_line(faulty):
    report = reports(faulty, faulty.run, b"atomic missing")[0]
    assert report.count("faulty.cu:") == 2


def test_freed_memory(faulty):
    for report in reports(faulty, faulty.use_freed_memory):
        assert "memory of no allocation is used" in (report or "nothing")


def test_host_that_does_not_wait_reads_nothing_in_some_orders(faulty):
    values = []
    reports(faulty, lambda: values.append(faulty.read_too_early()))
    assert any(math.isnan(x) for x in values)
    assert any(x == 0 for x in values)


def test_stream_that_does_not_wait_for_another_is_reported_in_some_orders(faulty):
    messages = reports(faulty, faulty.two_streams, False)
    assert any("copying device memory that nothing wrote" in (report or "") for report in messages)
    assert reports(faulty, faulty.two_streams, True) == [None] * len(SEEDS)
