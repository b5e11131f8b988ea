from pathlib import Path

from texgs.core.cache import cache_folder, keep, recall, weights_folder


def test_environment_chooses(monkeypatch):
    monkeypatch.setenv("TEXGS_CACHE", "/a")
    monkeypatch.delenv("TEXGS_WEIGHTS", raising=False)
    assert cache_folder() == Path("/a")
    assert weights_folder() == Path("/a/weights")
    monkeypatch.setenv("TEXGS_WEIGHTS", "/b")
    assert weights_folder() == Path("/b")


def test_default_is_the_users_cache(monkeypatch):
    monkeypatch.delenv("TEXGS_CACHE", raising=False)
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


def test_a_folder_that_cannot_be_written_to_is_no_error(tmp_path):
    (tmp_path / "file").write_text("")
    keep(tmp_path / "file" / "plan.json", "a", 1)
    assert recall(tmp_path / "file" / "plan.json", "a") is None
