"""Slips in the files of conf/: one sentence with the file and the line."""

import pytest

from texgs.config.compose import compose
from texgs.core.errors import ConfigError

MANY = "9" * 400


@pytest.fixture
def mine(tmp_path, monkeypatch):
    """Where the user's data set is."""
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "conf" / "dataset" / "mine.yaml"
    path.parent.mkdir(parents=True)
    return path


def told(*words):
    with pytest.raises(ConfigError) as error:
        compose(words)
    text = str(error.value)
    assert "\n" not in text
    assert len(text) < 500
    return text


@pytest.mark.parametrize(
    ("text", "where", "message"),
    [
        ("name: x\ntitle: [1, 2\nvolume:\n", ":3: ", "expected ',' or ']'"),
        ("name: x\nsource: !!timestamp 2026-11-20\n", ": source: ", ""),
        ("name: x\nimage: 2026-11-20\n", ":2: dataset.image: ", "expected an integer, got '2026-11-20'"),
        ("- name: x\n", ":1: dataset: ", "expected keys with values, got a list"),
        ("12\n", ": ", "int"),
        ("name: x\nvolume:\n", ":2: dataset.volume: ", "expected keys with values, got null"),
        ("name: x\nbasic_tfs:\n  - a\n", ":3: dataset.basic_tfs: ", "got a list"),
        ("name: x\nbasic_tfs:\n  A: [1]\n", ":3: dataset.basic_tfs.A: ", "got a list"),
        ("name: x\nname: y\n", ":2: ", "duplicate key name"),
        ("name: x\ntitle: für\n".encode("latin1"), ": ", "save it as UTF-8"),
        ("name: x\ntitle: a\0b\n", ": ", "#x0000"),
        (f"name: x\nimage: {MANY}\n", ":2: dataset.image: ", "expected an integer of 64 bits, got 9999"),
        (f"name: x\nbasic_tfs:\n  A:\n    opacity: [[1, 0], [{MANY}, 1]]\n", ":4: ", "64 bits"),
        ("name: x\nimage: -1\n", ":2: dataset.image: ", "expected at least 1, got -1"),
        ("name: x\nvolume:\n  spacing: [1, .nan, 1]\n", ":3: ", "expected a finite number, got nan"),
        ("name: x\nvolum: 3\n", ":2: dataset.volum: ", "no such key"),
        ("name: x\ntitle: ${\n", ": title: ", ""),
        ("name: x\ntitle: !!python/object:os.system y\n", ":2: ", "could not determine a constructor"),
        (f"name: x\ntitle: {'[' * 3000}{']' * 3000}\n", ": ", "recursion"),
    ],
)
def test_names_the_file_and_the_line_or_the_key(mine, text, where, message):
    mine.write_bytes(text if isinstance(text, bytes) else text.encode())
    error = told("dataset=mine")
    assert error.startswith(f"conf/dataset/mine.yaml{where}")
    assert message in error


def test_a_key_that_is_missing_names_the_folder(mine):
    mine.write_text("title: x\n")
    assert told("dataset=mine") == (
        "dataset.name: expected a value, got none; write it into the file of conf/dataset"
    )


def test_lists_in_lists_are_no_slip(mine):
    path = mine.parents[1] / "experiment" / "mine.yaml"
    path.parent.mkdir()
    path.write_text("defaults: [override /fit: quick]\ngallery: {grids: [{rows: [{title: a}]}]}\n")
    assert "Did you mean to override fit?" in told("experiment=mine"), "it lacks # @package _global_"


def test_a_file_that_is_not_chosen_does_no_harm(mine):
    mine.write_text("name: [\n")
    assert compose(("dataset=engine",)).dataset.name == "engine"
    assert told("dataset=engine", "views.widht=3").startswith("views.widht: no such key")


def test_a_name_that_yaml_does_not_read_as_text(mine):
    mine.write_text("name: no\n")
    assert "dataset.name: False is a word that YAML or Hydra does not read as text" in told("dataset=mine")
