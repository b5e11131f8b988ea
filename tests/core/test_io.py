"""Files that are written whole or not at all, and those of tensors."""

import errno
import json
import math
import os
import stat
import tracemalloc

import pytest
import torch
from safetensors import safe_open
from safetensors.torch import load_file

from tests.refusals import refused
from texgs.core import io
from texgs.core.errors import MAX_LETTERS, ArgumentError, TexgsError, printable
from texgs.core.image import read_rgba
from texgs.core.io import read_json, write_bytes
from texgs.core.tensor_file import DTYPES, read_tensor_file, write_tensor_file, write_tensors


def test_json_round_trip_creates_folders(tmp_path):
    path = io.write_json(tmp_path / "a" / "b.json", {"z": 1, "a": [0.5, None]})
    assert read_json(path) == {"z": 1, "a": [0.5, None]}
    assert path.read_text().startswith('{\n  "z": 1')
    assert path.read_text().endswith("}\n")


@pytest.mark.parametrize(
    ("error", "raised", "message"),
    [
        (RuntimeError("disk on fire"), RuntimeError, "disk on fire"),
        (OSError(errno.ENOSPC, "No space left on device"), ArgumentError, "no space left there"),
    ],
)
def test_failed_write_leaves_the_old_file_and_no_other(tmp_path, error, raised, message):
    path = write_bytes(tmp_path / "file", b"old")

    def fail(file):
        file.write(b"half")
        raise error

    refused(lambda: io.write_atomic(path, fail), message, raised)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.skipif(os.name == "nt", reason="file modes are POSIX")
def test_mode_follows_the_umask(tmp_path):
    old = os.umask(0o027)
    try:
        path = write_bytes(tmp_path / "file", b"")
    finally:
        os.umask(old)
    assert stat.S_IMODE(path.stat().st_mode) == 0o640


def test_mistakes_are_named(tmp_path):
    path = write_bytes(tmp_path / "bad.json", b"")
    refused(lambda: io.write_json(tmp_path / "x.json", {"x": float("nan")}), "x.json: .*JSON")
    refused(lambda: read_json(tmp_path / "none.json"), "none.json: no such file")
    refused(lambda: write_bytes(path / "below", b""), "below: cannot write there")
    for text, named in ((b"{\n]", "line 2"), (b"[" * 100_000, "nested"), (b"9" * 5000, "limit")):
        refused(lambda text=text: read_json(write_bytes(path, text)), f"{path}: expected JSON, got .*{named}")


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (ValueError("no\n  good"), "f: expected a thing, got no good; is the file damaged"),
        (KeyError("size"), "got a header without 'size'"),
        (RecursionError("maximum"), "nested too deeply"),
        (AssertionError(), "got AssertionError"),
        (PermissionError(13, "Permission denied"), r"f: cannot be read \(Permission denied\)"),
        (OSError("broken data stream"), "got broken data stream"),
    ],
)
def test_what_a_library_raises_is_one_sentence(tmp_path, error, message):
    path = write_bytes(tmp_path / "f", b"")
    with pytest.raises(ArgumentError, match=message), io.reading(path, "a thing"):
        raise error


@pytest.mark.skipif(os.name == "nt", reason="named pipes are POSIX")
def test_a_named_pipe_a_folder_and_a_device_are_no_files(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    kinds = ((tmp_path / "pipe", "a named pipe"), (tmp_path, "a folder"), ("/dev/zero", "a device"))
    for read in (read_json, read_rgba):
        for path, kind in kinds:
            refused(lambda read=read, path=path: read(path), f"got {kind}")
    refused(lambda: write_bytes(tmp_path / "pipe", b""), "a named pipe")


def test_a_message_is_one_line_of_bounded_length_that_a_terminal_can_show():
    name = "a\x1b[2J\u202eb\n\udcff"
    assert str(TexgsError(f"{name}: no")) == "a\\x1b[2J\\u202eb \\udcff: no"
    assert len(str(TexgsError("x" * 10**6 + "; do this"))) <= MAX_LETTERS + 5 <= 605
    assert str(TexgsError("x" * 10**6 + "; do this")).endswith("; do this")
    assert printable("naïve 体积 ½") == "naïve 体积 ½"
    assert str(TexgsError(name)).isprintable()


TENSORS = {"x": torch.arange(6.0).reshape(2, 3)}


@pytest.mark.parametrize(
    ("header", "named"),
    [
        ({"texgs-other": "{}"}, "another program"),
        ({"texgs-test": json.dumps({"version": 2})}, "got 2"),
        *(({"texgs-test": text}, "JSON with a version") for text in ("{}", "[" * 100_000)),
    ],
)
def test_a_header_of_something_else(tmp_path, header, named):
    path = write_tensors(tmp_path / "file", TENSORS, header)
    refused(lambda: read_tensor_file(path, "texgs-test", 1), named)


@pytest.mark.parametrize("metadata", [{"loss": math.nan}, {"camera": object()}])
def test_metadata_that_is_no_json(tmp_path, metadata):
    path, description = tmp_path / "file", {"metadata": metadata}
    refused(lambda: write_tensor_file(path, "texgs-test", description, TENSORS), "metadata ")
    assert not path.exists()


def test_the_library_reads_what_was_written(tmp_path):
    tensors = {str(dtype): torch.arange(6).reshape(2, 3).to(dtype) for dtype in DTYPES}
    tensors |= {"one": torch.tensor(3), "none": torch.empty(0, 4), "turned": torch.rand(3, 5).T}
    path = write_tensors(tmp_path / "a.safetensors", tensors, {"about": "a test"})
    read = load_file(path)
    assert set(read) == set(tensors)
    for name, x in tensors.items():
        assert torch.equal(read[name], x)
        assert read[name].dtype == x.dtype
    with safe_open(path, "pt") as file:
        assert file.metadata() == {"about": "a test"}
    again = write_tensors(tmp_path / "b.safetensors", dict(reversed(tensors.items())), {"about": "a test"})
    assert path.read_bytes() == again.read_bytes()


def test_nothing_is_copied(tmp_path):
    large = {"x": torch.rand(2_000_000)}
    tracemalloc.start()
    write_tensors(tmp_path / "a.safetensors", large)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 1_000_000, "of 8,000,000 bytes"
