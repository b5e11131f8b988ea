import pytest
import yaml

from texgs.core.errors import ArgumentError
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


def test_what_grows_is_refused():
    laughs = "a: &a [x, x]\n" + "\n".join(
        f"{chr(98 + i)}: &{chr(98 + i)} [*{chr(97 + i)}, *{chr(97 + i)}]" for i in range(20)
    )
    with pytest.raises(ArgumentError, match=r"got an alias \(\*name\) in line 2; write them out"):
        parse_yaml(laughs)
    with pytest.raises(ArgumentError, match="expected each key once, got b again in line 4; rename it"):
        parse_yaml("a:\n  b: 1\n  c: 2\n  b: 3")
    with pytest.raises(ArgumentError, match="expected at most 20 tables and lists in one another"):
        parse_yaml("[" * 100_000)
    for tagged in ("!!bool x", "a: !!timestamp x", "!!int ''", "!!python/object:os.system {}"):
        with pytest.raises(ArgumentError, match=r"expected values, got the tag .* in line 1; leave it out"):
            parse_yaml(tagged)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: 1\n\n`b`: 2", r"got a mistake in line 3 \(found character '`' that cannot start any token\)"),
        ("a: [1, 2\nb: 3", "got a mistake in line 2"),
    ],
)
def test_what_is_no_yaml_is_one_sentence_with_its_line(text, message):
    with pytest.raises(ArgumentError, match=f"^expected YAML, {message}.*; correct it$"):
        parse_yaml(text)
