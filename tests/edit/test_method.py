"""What is wrong with a method of one's own is told in a sentence."""

from dataclasses import dataclass, replace

import pytest

from tests.toys.fade import METHOD
from texgs.core.errors import ConfigError
from texgs.core.keys import key
from texgs.edit.method import MethodKeys
from texgs.edit.task import run_method


@dataclass(frozen=True)
class Plain(MethodKeys):
    """A key that says nothing of itself."""

    levels: int = 3


class Undecorated(MethodKeys):
    """Forgot what makes it a dataclass."""

    levels: int = key(3, "levels")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"needs": frozenset({"texure"})}, "fade: needs: texure is nothing .* can do, did you mean texture?"),
        ({"needs": "texture"}, r"method fade: needs: expected a set, {'texture'}, got text"),
        ({"name": "my toon"}, "METHOD: expected letters, digits and _ in its name, got 'my toon'"),
        ({"summary": ""}, "method fade: summary: expected words for texgs --help, got none"),
        ({"run": lambda: None}, r"method fade: expected <lambda>\(task\), got <lambda>\(\)"),
        ({"run": "run"}, "method fade: expected a function, got str"),
        ({"settings": Plain}, r"method fade: levels: expected key\(DEFAULT, HELP\), got no key\(\)"),
        ({"settings": Undecorated}, r"method fade: Undecorated: write @dataclass\(frozen=True\) above it"),
        ({"settings": dict}, "method fade: expected keys of a subclass of MethodKeys, got dict"),
    ],
)
def test_what_a_method_says_of_itself_is_checked(changes, message):
    with pytest.raises(ConfigError, match=message):
        replace(METHOD, **changes)


def test_what_a_method_returns_is_checked():
    with pytest.raises(ConfigError, match="method fade: expected an EditedScene, got str"):
        run_method(replace(METHOD, run=lambda task: "done"), 1)
