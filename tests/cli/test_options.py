"""Options of a dataclass: what a command line says becomes the dataclass, or one sentence."""

import re
from dataclasses import dataclass, replace
from typing import Literal

import pytest

from texgs.cli.options import Parser, add_keys, keys_of
from texgs.core.errors import ArgumentError
from texgs.core.keys import REQUIRED, key


@dataclass(frozen=True)
class Drawing:
    """Options of every kind."""

    title: str = key(REQUIRED, "what stands above")
    line_width: float = key(1.5, "of lines", "pixels", above=0, option="width")
    count: int | None = key(None, "of lines; default 100 % of them", least=1)
    paper: Literal["a4", "letter"] = key("a4", "what it is drawn on")
    corner: tuple[float, float] | None = key(None, "where it starts")
    colours: tuple[str, ...] = key((), "of lines")
    is_dashed: bool = key(False, "lines have gaps", option="dashed")
    number: int = 0  # no option


PLAIN = Drawing("a")


def parser():
    made = Parser(prog="draw")
    add_keys(made, Drawing)
    return made


@pytest.mark.parametrize(
    ("words", "change"),
    [
        ("", {}),
        ("--width 2 --count 3", {"line_width": 2.0, "count": 3}),
        ("--corner -1 .5 --paper letter", {"corner": (-1.0, 0.5), "paper": "letter"}),
        ("--colours red green --dashed", {"colours": ("red", "green"), "is_dashed": True}),
    ],
)
def test_options_are_the_dataclass(words, change):
    arguments = parser().parse_args(["--title", "a", *words.split()])
    assert keys_of(arguments, Drawing) == replace(PLAIN, **change)
    assert keys_of(arguments, Drawing, number=7) == replace(PLAIN, **change, number=7)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--width 0", "--width: expected more than 0, got 0.0"),
        ("--count many", "--count: expected an integer, got 'many'"),
        ("--paper leter", "--paper: expected one of a4, letter, got leter, did you mean letter?"),
        ("--corner 1 x", "--corner: expected a number, got 'x'"),
    ],
)
def test_what_is_wrong_is_told_by_its_option(words, message):
    with pytest.raises(ArgumentError, match=re.escape(message)):
        keys_of(parser().parse_args(["--title", "a", *words.split()]), Drawing)


def test_the_help_has_units_and_defaults(capsys):
    with pytest.raises(SystemExit):
        parser().parse_args(["--help"])
    told = " ".join(capsys.readouterr().out.split())
    assert "--width WIDTH of lines, pixels (1.5)" in told
    assert "--paper {a4,letter} what it is drawn on (a4)" in told
    assert "default 100 % of them" in told
    assert "--number" not in told
    with pytest.raises(SystemExit):
        parser().parse_args([])  # the title is required
