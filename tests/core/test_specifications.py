"""What modules define is found by its name; what is wrong with a module is told in one sentence."""

import pytest

from texgs.core.errors import ConfigError
from texgs.core.specifications import specifications

MODULE = "class One:\n    name = {!r}\nTHING = One()\n"


@pytest.fixture
def package(tmp_path, monkeypatch, request):
    """An empty package of a name of its own, whose folder is to be filled."""
    name = f"toys_{len(request.node.name)}"  # which no other test here has
    folder = tmp_path / name
    folder.mkdir()
    (folder / "__init__.py").touch()
    monkeypatch.syspath_prepend(tmp_path)
    specifications.cache_clear()
    yield folder
    specifications.cache_clear()


def test_helpers_are_passed_by(package):
    (package / "a.py").write_text(MODULE.format("first"))
    (package / "helper.py").write_text("X = 1\n")
    assert list(specifications(package.name, "THING")) == ["first"]


def test_two_of_one_name(package):
    for file in ("a.py", "b.py"):
        (package / file).write_text(MODULE.format("first"))
    with pytest.raises(
        ConfigError, match=r"\.a and .*\.b: expected THING of different names, got first twice"
    ):
        specifications(package.name, "THING")


def test_what_is_no_specification(package):
    (package / "a.py").write_text("def THING(): pass\n")
    with pytest.raises(ConfigError, match=r"\.a: THING: expected a specification with a name, got function"):
        specifications(package.name, "THING")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "import nope_of_texgs",
            "line 1: ModuleNotFoundError where it is imported: No module named 'nope_of_texgs'",
        ),
        ("THING = (", r"SyntaxError where it is imported: '\(' was never closed \(broken.py, line 1\)"),
        ("x = 1\nraise ValueError('odd')", "line 2: ValueError where it is imported: odd"),
    ],
)
def test_a_module_that_cannot_be_imported(package, text, message):
    (package / "broken.py").write_text(text)
    with pytest.raises(ConfigError, match=rf"\.broken[:,] {message}$"):
        specifications(package.name, "THING")
