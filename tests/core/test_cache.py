import hashlib
import json
import os
from pathlib import Path

import pytest

from tests.refusals import refused
from texgs.core import cache as checksum
from texgs.core.cache import (
    Checksums,
    cache_folder,
    checksum_of_folders,
    combined_checksum,
    keep,
    recall,
    sha256,
    weights_folder,
)


def test_the_environment_chooses_and_the_default_is_the_users_cache(monkeypatch):
    monkeypatch.setenv("TEXGS_CACHE", "/a")
    monkeypatch.delenv("TEXGS_WEIGHTS", raising=False)
    assert (cache_folder(), weights_folder()) == (Path("/a"), Path("/a/weights"))
    monkeypatch.setenv("TEXGS_WEIGHTS", "/b")
    assert weights_folder() == Path("/b")
    monkeypatch.delenv("TEXGS_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", "/c")
    assert cache_folder() == Path("/c/texgs")
    monkeypatch.delenv("XDG_CACHE_HOME")
    assert cache_folder() == Path.home() / ".cache" / "texgs"


def test_what_is_kept_is_recalled_for_the_same_key_alone(tmp_path):
    path = tmp_path / "folder" / "plan.json"
    assert recall(path, "a") is None
    keep(path, "a", {"jobs": [1, None, "é"]})
    assert recall(path, "a") == {"jobs": [1, None, "é"]}
    assert recall(path, "b") is None
    for damaged in ("", "{", "[1]", '{"key": "a"}'):
        path.write_text(damaged)
        assert recall(path, "a") is None
    keep(path / "below a file", "a", 1)  # costs time only
    assert recall(path / "below a file", "a") is None


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("TEXGS_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache" / checksum.CHECKSUMS_FILE


@pytest.fixture
def path(tmp_path):
    (tmp_path / "data").write_bytes(b"one")
    return tmp_path / "data"


def test_it_is_the_sha256_of_the_contents(path):
    assert sha256(path) == Checksums().of(path) == hashlib.sha256(b"one").hexdigest()
    for of in (sha256, Checksums().of):
        refused(lambda of=of: of(path.with_name("no")), "no: cannot be read")


def test_a_file_is_read_once_while_its_size_and_time_stay(path, monkeypatch):
    read = []
    monkeypatch.setattr(checksum, "sha256", lambda path: read.append(path) or sha256(path))
    known = Checksums()
    first = known.of(path)
    known.save()
    again = Checksums.load()
    assert again.of(path) == first
    assert len(read) == 1
    path.write_bytes(b"two")
    os.utime(path, ns=(1, 1))
    assert again.of(path) == sha256(path) != first
    again.forget(path)
    assert again.of(path) != first
    assert len(read) == 3


@pytest.mark.parametrize("content", ["", "[1]", '{"a": 3}', '{"key": "checksums.json", "value": 3}'])
def test_a_damaged_cache_is_an_empty_one(path, cache, content):
    cache.parent.mkdir()
    cache.write_text(content)
    assert Checksums.load().of(path) == sha256(path)
    keep(cache, checksum.CHECKSUMS_FILE, {str(path): "not a list"})
    assert Checksums.load().of(path) == sha256(path)


def test_the_latest_files_are_kept(tmp_path, cache, monkeypatch):
    monkeypatch.setattr(checksum, "MAX_CHECKSUMS", 2)
    checksums = Checksums.load()
    for name in "abc":
        (tmp_path / name).write_text(name)
        checksums.of(tmp_path / name)
    checksums.save()
    assert [Path(path).name for path in json.loads(cache.read_text())["value"]] == ["b", "c"]


def test_a_cache_that_cannot_be_written_costs_time_only(path, cache):
    cache.parent.write_text("a file where the folder should be")
    known = Checksums()
    assert known.of(path) == sha256(path)
    known.save()


def test_combined_knows_names_and_not_their_order():
    assert combined_checksum([("a", "1"), ("b", "2")]) == combined_checksum([("b", "2"), ("a", "1")])
    assert combined_checksum([("a", "1"), ("b", "2")]) != combined_checksum([("a", "2"), ("b", "1")])
    assert combined_checksum([("a", "1")]) != combined_checksum([])


def test_digests_of_folders_differ_by_contents_and_names_but_not_by_what_python_compiled(tmp_path):
    (tmp_path / "below").mkdir()
    file = tmp_path / "below" / "a.py"
    file.write_text("1")
    digests = {checksum_of_folders(tmp_path)}
    (tmp_path / "__pycache__").mkdir()
    (tmp_path / "__pycache__" / "a.pyc").write_text("compiled")
    digests.add(checksum_of_folders(tmp_path))
    assert len(digests) == 1
    file.write_text("2")
    digests.add(checksum_of_folders(tmp_path))
    file.rename(tmp_path / "b.py")
    digests.add(checksum_of_folders(tmp_path))
    assert len(digests) == 3
