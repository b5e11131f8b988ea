import json
import os
import re
import sys

import numpy as np
import pytest
import torch

from texgs.core import memory
from texgs.core.errors import LONGEST, ArgumentError, OutOfMemoryError, TexgsError, printable
from texgs.core.image import read_rgba
from texgs.core.io import read_json, reading, reading_as, write_bytes


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (ValueError("no\n  good"), r"f: expected a thing, got no good; is the file damaged"),
        (KeyError("size"), r"expected a thing, got a header without 'size'"),
        (RecursionError("maximum"), r"expected a thing, got what is nested too deeply"),
        (AssertionError(), r"expected a thing, got AssertionError"),
        (PermissionError(13, "Permission denied"), r"f: cannot be read \(Permission denied\)"),
        (OSError("broken data stream"), r"expected a thing, got broken data stream"),
    ],
)
def test_what_a_library_raises_is_one_sentence(tmp_path, error, message):
    path = write_bytes(tmp_path / "f", b"")
    with pytest.raises(ArgumentError, match=message), reading(path, "a thing"):
        raise error


def test_memory_that_is_not_there_says_how_much_was_wanted():
    wanted = r"a thing needs more memory than there is .*512\. PiB"
    with pytest.raises(OutOfMemoryError, match=wanted), reading_as("a thing"):
        np.empty(2**56)
    wanted = r"more memory .*\(512\. PiB wanted at once, .* GiB are free\)"
    with pytest.raises(OutOfMemoryError, match=wanted), memory.as_out_of_memory():
        np.empty(2**56)
    with pytest.raises(OutOfMemoryError, match=r"\(\d+ bytes wanted at once"), memory.as_out_of_memory():
        torch.empty(2**55)
    with pytest.raises(OutOfMemoryError, match=r"f: needs \d.* GiB of memory, but .* GiB are free; go"):
        memory.require_memory(2**60, "f", "go")


def test_a_container_has_what_it_may_have_and_what_files_give_back(tmp_path, monkeypatch):
    monkeypatch.setattr(memory, "CGROUP", tmp_path)
    (tmp_path / "memory.current").write_text("900000\n")
    (tmp_path / "memory.stat").write_text("anon 1\nfile 9\ninactive_file 300000\nactive_file 50000\n")
    (tmp_path / "memory.max").write_text("1000000\n")
    assert memory.free_memory() == 450_000
    (tmp_path / "memory.max").write_text("max\n")
    assert memory.free_memory() > 1e6


def test_a_group_inside_of_others_has_what_the_tightest_leaves(tmp_path, monkeypatch):
    """As the jobs of a cluster are in."""
    (tmp_path / "own").write_text("0::/slurm/job_7\n")
    (job := tmp_path / "slurm" / "job_7").mkdir(parents=True)
    monkeypatch.setattr(memory, "CGROUP", tmp_path)
    monkeypatch.setattr(memory, "GROUP", tmp_path / "own")
    for folder, most in ((job, 500_000), (job.parent, 300_000)):
        (folder / "memory.max").write_text(f"{most}\n")
        (folder / "memory.current").write_text("100000\n")
        (folder / "memory.stat").write_text("inactive_file 0\n")
    assert memory.free_memory() == 200_000
    (job.parent / "memory.max").write_text("max\n")
    assert memory.free_memory() == 400_000


def test_a_group_of_the_first_version_counts(tmp_path, monkeypatch):
    (tmp_path / "own").write_text("12:pids:/a\n4:cpu,memory:/slurm/job_7\n1:name=systemd:/b\n")
    (job := tmp_path / "memory" / "slurm" / "job_7").mkdir(parents=True)
    monkeypatch.setattr(memory, "CGROUP", tmp_path)
    monkeypatch.setattr(memory, "GROUP", tmp_path / "own")
    (job / "memory.limit_in_bytes").write_text("500000\n")
    (job / "memory.usage_in_bytes").write_text("300000\n")
    (job / "memory.stat").write_text("cache 9\ninactive_file 100000\ntotal_inactive_file 100000\n")
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


@pytest.mark.skipif(os.name == "nt", reason="named pipes are POSIX")
def test_a_named_pipe_a_folder_and_a_device_are_no_files(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path, kind in (
        (tmp_path / "pipe", "a named pipe"),
        (tmp_path, "a folder"),
        ("/dev/zero", "a device"),
    ):
        for read in (read_json, read_rgba):
            with pytest.raises(ArgumentError, match=rf"expected .*, got {kind}"):
                read(path)
    with pytest.raises(ArgumentError, match="got a device or a named pipe"):
        write_bytes(tmp_path / "pipe", b"")


def test_deep_and_long_json(tmp_path):
    with pytest.raises(ArgumentError, match="expected JSON, got what is nested too deeply"):
        read_json(write_bytes(tmp_path / "deep.json", b"[" * 100_000))
    with pytest.raises(ArgumentError, match="expected JSON, got Exceeds the limit"):
        read_json(write_bytes(tmp_path / "long.json", b"9" * 5000))


def test_a_message_is_one_line_of_bounded_length_that_a_terminal_can_show():
    name = "a\x1b[2J\u202eb\n\udcff"
    assert str(TexgsError(f"{name}: no")) == "a\\x1b[2J\\u202eb \\udcff: no"
    assert len(str(TexgsError("x" * 10**6 + "; do this"))) <= LONGEST + 5 <= 605
    assert str(TexgsError("x" * 10**6 + "; do this")).endswith("; do this")
    assert printable("naïve 体积 ½") == "naïve 体积 ½"
    assert json.loads(json.dumps(str(TexgsError(name)))).isprintable()
