"""What modules define is found by its name; what is wrong with a module is told in one sentence."""

import pytest

from tests.refusals import refused
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
    refused(lambda: specifications(package.name, "THING"), r"\.a and .*\.b: .*first twice", ConfigError)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("def THING(): pass", "THING: .*function"),
        ("import nope_of_texgs", "line 1: ModuleNotFoundError .*'nope_of_texgs'"),
        ("THING = (", r"SyntaxError .*broken.py, line 1"),
        ("x = 1\nraise ValueError('odd')", "line 2: ValueError .*odd"),
    ],
)
def test_a_module_that_cannot_be_used(package, text, named):
    (package / "broken.py").write_text(text)
    refused(lambda: specifications(package.name, "THING"), rf"\.broken[:,] {named}", ConfigError)
