from pathlib import Path

from texgs.core.folders import cache_folder, weights_folder


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
