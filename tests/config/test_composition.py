"""Compositions are kept for later processes, and are those that Hydra makes now."""

import sqlite3

import pytest

from texgs.config import compose as composing
from texgs.config import composition as hydra
from texgs.config.compose import compose
from texgs.config.project import ROOT
from texgs.core.errors import ConfigError

SHIPPED = ROOT / "conf"


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """The file of an empty cache."""
    monkeypatch.setenv("TEXGS_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache" / hydra.CACHE


@pytest.fixture
def made(monkeypatch):
    """The words of all compositions that Hydra was asked for."""
    words = []
    composed = hydra.composed

    def noted(overrides, places):
        words.append(overrides)
        return composed(overrides, places)

    monkeypatch.setattr(hydra, "composed", noted)
    return words


def again(*words, places=(SHIPPED,)):
    """The composition in a new process."""
    hydra.composition.cache_clear()
    return hydra.composition(words, places)


def test_a_second_process_does_not_ask_hydra(cache, made):
    first = again("dataset=engine", "views.width=77")
    assert again("dataset=engine", "views.width=77") == first
    assert len(made) == 1
    assert first["views"]["width"] == 77
    assert again("views.width=78")["views"]["width"] == 78


def test_a_file_that_changes_is_read_again(cache, tmp_path):
    own = tmp_path / "conf"
    (own / "views").mkdir(parents=True)
    places = own, SHIPPED
    (own / "views" / "mine.yaml").write_text("width: 5\n")
    assert again("views=mine", places=places)["views"]["width"] == 5
    (own / "views" / "mine.yaml").write_text("width: 66\n")
    assert again("views=mine", places=places)["views"]["width"] == 66
    (own / "views" / "default.yaml").write_text("width: 777\n")  # in front of that of texgs
    assert again(places=places)["views"]["width"] == 777


def test_a_link_by_which_an_editor_locks_a_file_is_no_mistake(cache, tmp_path):
    (tmp_path / "conf").mkdir()
    (tmp_path / "conf" / ".#mine.yaml").symlink_to("me@machine.4711")
    assert again(places=(tmp_path / "conf", SHIPPED))["views"]


def test_other_keys_of_texgs_are_another_composition(cache, made, monkeypatch):
    again()
    monkeypatch.setattr(hydra, "libraries", lambda: ("a new key",))
    again()
    assert len(made) == 2


def test_interpolations_are_resolved_when_they_are_read(cache, monkeypatch):
    monkeypatch.setenv("TEXGS_DATA", "/first")
    kept = again()
    monkeypatch.setenv("TEXGS_DATA", "/second")
    assert again() == kept
    assert kept["data_folder"].startswith("${oc.env:")
    composing._assembled.cache_clear()
    assert compose().data_folder == "/second"
    composing._assembled.cache_clear()


@pytest.mark.parametrize("damage", [b"", b"no database", b"SQLite format 3\0 and then nothing"])
def test_a_damaged_cache_is_none(cache, made, damage):
    first = again()
    cache.write_bytes(damage)
    assert again() == first
    assert len(made) == 2


def test_a_row_that_is_no_json_is_made_again(cache, made):
    first = again()
    with sqlite3.connect(cache) as connection:
        connection.execute("UPDATE compositions SET made = '{'")
    assert again() == first
    assert len(made) == 2


def test_a_cache_that_cannot_be_written_stops_nothing(cache, tmp_path):
    cache.parent.write_text("a file where the folder should be")
    assert again()["views"]


def test_the_oldest_are_taken_out(cache, monkeypatch):
    monkeypatch.setattr(hydra, "MOST", 2)
    for width in (1, 2, 3):
        again(f"views.width={width}")
    with sqlite3.connect(cache) as connection:
        assert connection.execute("SELECT COUNT(*) FROM compositions").fetchone() == (2,)


def test_what_json_changes_is_not_kept(cache):
    hydra.keep("key", {1: "a number as a key"})
    hydra.keep("nan", {"value": float("nan")})
    assert hydra.kept("key") is None
    assert hydra.kept("nan") is None


@pytest.mark.parametrize(
    ("words", "key", "expected"),
    [
        (("edit=glass", "edit.seed=${fit.seed}", "fit.seed=7"), "edit", 7),
        (("fit=quick", "fit.seed=${views.width}", "views.width=41"), "fit", 41),
    ],
)
def test_groups_that_refer_to_others_get_their_values(words, key, expected):
    assert compose(words)[key].seed == expected


def test_other_keys_may_refer_to_groups():
    assert compose(("fit=quick", "results=out/${fit.name}")).results == "out/quick"


def test_a_value_that_is_missing_is_a_mistake():
    with pytest.raises(ConfigError, match=r"views\.width"):
        compose(("views.width='???'",))


def test_two_configurations_share_what_is_the_same():
    one, other = compose(("dataset=engine",)), compose(("dataset=engine", "views.width=123"))
    assert one.fit is other.fit
