import errno
import os
import stat

import pytest

from texgs.core import io
from texgs.core.errors import ArgumentError


def test_json_round_trip_creates_folders(tmp_path):
    path = io.write_json(tmp_path / "a" / "b.json", {"z": 1, "a": [0.5, None]})
    assert io.read_json(path) == {"z": 1, "a": [0.5, None]}
    assert path.read_text().startswith('{\n  "z": 1')
    assert path.read_text().endswith("}\n")


def test_failed_write_leaves_the_old_file_and_no_other(tmp_path):
    path = io.write_bytes(tmp_path / "file", b"old")

    def fail(file):
        file.write(b"half")
        raise RuntimeError("disk on fire")

    with pytest.raises(RuntimeError, match="disk on fire"):
        io.write_atomic(path, fail)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.skipif(os.name == "nt", reason="file modes are POSIX")
def test_mode_follows_the_umask(tmp_path):
    old = os.umask(0o027)
    try:
        path = io.write_bytes(tmp_path / "file", b"")
    finally:
        os.umask(old)
    assert stat.S_IMODE(path.stat().st_mode) == 0o640


def test_mistakes_are_named(tmp_path):
    with pytest.raises(ArgumentError, match="cannot be written as JSON"):
        io.write_json(tmp_path / "x.json", {"x": float("nan")})
    with pytest.raises(ArgumentError, match="no such file"):
        io.read_json(tmp_path / "none.json")
    io.write_bytes(tmp_path / "bad.json", b"{\n]")
    with pytest.raises(ArgumentError, match=r"expected JSON, got .*line 2"):
        io.read_json(tmp_path / "bad.json")
    with pytest.raises(ArgumentError, match="cannot write there"):
        io.write_bytes(tmp_path / "bad.json" / "below", b"")


def test_a_full_disk_is_one_sentence(tmp_path):
    def fill(_file):
        raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(ArgumentError, match="no space left there"):
        io.write_atomic(tmp_path / "a", fill)
    assert list(tmp_path.iterdir()) == []
