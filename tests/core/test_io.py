import errno
import os
import stat

import pytest

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
    with pytest.raises(ArgumentError, match="cannot be written as JSON"):
        io.write_json(tmp_path / "x.json", {"x": float("nan")})
    with pytest.raises(ArgumentError, match="no such file"):
        read_json(tmp_path / "none.json")
    path = write_bytes(tmp_path / "bad.json", b"")
    with pytest.raises(ArgumentError, match="cannot write there"):
        write_bytes(path / "below", b"")
    wrong = {
        b"{\n]": ".*line 2",
        b"[" * 100_000: "what is nested",
        b"9" * 5000: "Exceeds the limit",
    }
    for text, message in wrong.items():
        with pytest.raises(ArgumentError, match=f"expected JSON, got {message}"):
            read_json(write_bytes(path, text))


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
    with pytest.raises(ArgumentError, match=message), io.reading(path, "a thing"):
        raise error


@pytest.mark.skipif(os.name == "nt", reason="named pipes are POSIX")
def test_a_named_pipe_a_folder_and_a_device_are_no_files(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    kinds = ((tmp_path / "pipe", "a named pipe"), (tmp_path, "a folder"), ("/dev/zero", "a device"))
    for path, kind in kinds:
        for read in (read_json, read_rgba):
            with pytest.raises(ArgumentError, match=rf"expected .*, got {kind}"):
                read(path)
    with pytest.raises(ArgumentError, match="got a device or a named pipe"):
        write_bytes(tmp_path / "pipe", b"")


def test_a_message_is_one_line_of_bounded_length_that_a_terminal_can_show():
    name = "a\x1b[2J\u202eb\n\udcff"
    assert str(TexgsError(f"{name}: no")) == "a\\x1b[2J\\u202eb \\udcff: no"
    assert len(str(TexgsError("x" * 10**6 + "; do this"))) <= LONGEST + 5 <= 605
    assert str(TexgsError("x" * 10**6 + "; do this")).endswith("; do this")
    assert printable("naïve 体积 ½") == "naïve 体积 ½"
    assert str(TexgsError(name)).isprintable()
