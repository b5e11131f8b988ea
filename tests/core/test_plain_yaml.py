import pytest
import yaml

from tests.refusals import refused
from texgs.core.plain_yaml import parse_yaml


@pytest.mark.parametrize(("text", "value"), [("5e-1", 0.5), ("-1E3", -1000.0), (".5e1", 5.0), ("2.e0", 2.0)])
def test_numbers_are_what_they_are_elsewhere(text, value):
    assert parse_yaml(text) == value
    assert isinstance(parse_yaml(text), float)
    assert parse_yaml(f"[{text}, e1, 1e, 1e1x]") == [value, "e1", "1e", "1e1x"]


def test_all_else_is_as_in_yaml():
    text = "a: [1, 2.5, true, null, x, '5e-1']\nb: {c: 0x10}\n"
    assert (
        parse_yaml(text) == yaml.safe_load(text) == {"a": [1, 2.5, True, None, "x", "5e-1"], "b": {"c": 16}}
    )


LAUGHS = "a: &a [x, x]\n" + "\n".join(f"{chr(98 + i)}: &{chr(98 + i)} [*{chr(97 + i)}]" for i in range(20))


NO_YAML = (
    (LAUGHS, "an alias .* line 2"),
    ("a:\n  b: 1\n  c: 2\n  b: 3", "b again in line 4"),
    ("[" * 100_000, "at most 20 tables and lists"),
    *((text, "tag .* line 1") for text in ("!!bool x", "a: !!timestamp x", "!!int ''", "!!python/name:a {}")),
    ("a: 1\n\n`b`: 2", "line 3"),
    ("a: [1, 2\nb: 3", "line 2"),
)


def test_what_grows_and_what_is_no_yaml_is_refused_with_its_line():
    for text, named in NO_YAML:
        refused(lambda text=text: parse_yaml(text), named)
