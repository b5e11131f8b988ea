from pathlib import Path

import pytest

from tests.refusals import refused
from texgs.core.errors import ArgumentError
from texgs.core.names import close, file_name, label, named_file, part_file, part_files


@pytest.mark.parametrize("name", ["", ".", "..", ".hidden", "a/b", "a\\b", "/etc", "a\0b", "a\nb", "é" * 126])
def test_what_is_no_name_of_a_file(name):
    refused(lambda: file_name("where", name), "where: ")


@pytest.mark.parametrize(
    ("names", "file"),
    [(("run/balls", "red"), "run-balls-red.safetensors"), (("x", "../../y"), "x-..-..-y.safetensors")],
)
def test_a_part_has_one_file_in_its_folder(names, file):
    assert part_file("where", *names) == file
    refused(lambda: part_file("where", "../../x", "y"), "dot at its start")


def test_parts_whose_names_give_one_file_have_two():
    parts = ["TF01-x", "TF01/x", "TF01-x/2", "TF02"]
    files = ["TF01-x.safetensors", "TF01-x-2.safetensors", "TF01-x-2-2.safetensors", "TF02.safetensors"]
    assert part_files("where", parts) == dict(zip(parts, files, strict=True))


@pytest.mark.parametrize("name", ["", " ", "a\x1b[2J", "\u202eb", "x" * 101])
def test_what_cannot_be_shown_is_no_label(name):
    with pytest.raises(ArgumentError, match="where: expected a name of 1 to 100 printable letters") as caught:
        label("where", name)
    assert str(caught.value).isprintable()


def test_names_labels_and_paths_that_are_taken():
    for name in ("TF01.safetensors", "ein Teil", "体积", "a..b", "-x"):
        assert file_name("where", name) == name
    assert label("where", 42) == "42"
    assert named_file("where", Path("a"), "../b c.png") == Path("a/../b c.png")
    assert named_file("where", Path("a"), "b\u00a0c.png") == Path("a/b\u00a0c.png")
    for path in (None, 3, "", "a\0", "x" * 1001, ["a"] * 10**6):
        with pytest.raises(ArgumentError, match="where: expected the path of a model, got") as caught:
            named_file("where", Path("a"), path, "a model")
        assert len(str(caught.value)) < 200


@pytest.mark.parametrize(
    ("word", "hint"),
    [
        ("z", ", did you mean +z or -z?"),
        ("opacitie", ", did you mean opacity?"),
        ("volume", ""),
        ("LUNG-CT", ", did you mean lung_ct?"),
        ("engine", ", did you mean Engine?"),
    ],
)
def test_a_hint_names_what_is_most_like_a_word(word, hint):
    assert close(word, ["+x", "-x", "+z", "-z", "opacity", "lung_ct", "Engine"]) == hint
