import errno
import os
import stat

import pytest

from tests.refusals import refused
from texgs.core import io
from texgs.core.errors import LONGEST, ArgumentError, TexgsError, printable
from texgs.core.image import read_rgba
from texgs.core.io import read_json, write_bytes


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

    with pytest.raises(raised, match=message):
        io.write_atomic(path, fail)
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
    assert len(str(TexgsError("x" * 10**6 + "; do this"))) <= LONGEST + 5 <= 605
    assert str(TexgsError("x" * 10**6 + "; do this")).endswith("; do this")
    assert printable("naïve 体积 ½") == "naïve 体积 ½"
    assert str(TexgsError(name)).isprintable()
