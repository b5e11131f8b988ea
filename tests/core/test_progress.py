import io
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.refusals import refused
from texgs.core import progress as module
from texgs.core.progress import progress, watching


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def clock(monkeypatch):
    """Seconds that pass only where a test adds them."""
    now = [100.0]
    monkeypatch.setattr(module, "monotonic", lambda: now[0])
    return now


@pytest.fixture
def log(capsys):
    """Reads the lines on stderr, which is no terminal here."""
    return lambda: capsys.readouterr().err.splitlines()


def test_log_file_gets_lines_at_most_every_second_later_every_five_and_a_last_one(clock, log):
    for _ in progress(range(160), title="views engine/TF01", unit="view"):
        clock[0] += 0.25
    lines = log()
    assert lines[0] == "views engine/TF01: 4 of 160 views, 4.0 view/s, 39 s left"
    assert lines[-1] == "views engine/TF01: 160 of 160 views, 4.0 view/s, took 40 s"
    assert all(re.search(module.LINE, line) for line in lines)
    done = [int(re.search(r": (\d+) of", line)[1]) for line in lines]
    assert done == [4, 8, 12, 16, 22, 30, 40, 54, 72, 92, 112, 132, 152, 160]


class Place(list):
    """What an output of a cell has shown."""

    def update(self, data, raw):
        assert raw
        self.append(data["text/plain"])

    display = update


def test_a_notebook_gets_a_bar_in_an_output_of_its_own_that_is_empty_when_it_is_done(monkeypatch, capsys):
    places = []
    monkeypatch.setitem(sys.modules, "ipykernel.kernelapp", sys)
    monkeypatch.setattr(module, "find_spec", lambda name: None)
    monkeypatch.setattr("IPython.display.DisplayHandle", lambda: places.append(Place()) or places[-1])
    for title in ("views", "steps"):
        assert list(progress(range(3), title=title, unit="view")) == [0, 1, 2]
    views, steps = places
    assert "views:   0%" in views[0]
    assert "steps:   0%" in steps[0]
    assert views[-1] == steps[-1] == ""
    assert capsys.readouterr() == ("", ""), "each piece of a stream is a line of its own in a file"


def test_slow_items_and_unknown_and_given_lengths(clock, log):
    for _ in progress(range(200), title="fit", unit="step"):
        clock[0] += 90
    lines = log()
    assert lines[0] == "fit: 1 of 200 steps, 90.0 s/step, 4 h 58 min left"
    assert lines[-1] == "fit: 200 of 200 steps, 90.0 s/step, took 5 h 00 min"
    for _ in progress((letter for letter in "abcd"), title="wait", unit="poll"):
        clock[0] += 3
    assert log() == [
        "wait: 1 poll, 3.0 s/poll",
        *(f"wait: {n} polls, 3.0 s/poll" for n in (2, 3, 4)),
        "wait: 4 polls, 3.0 s/poll, took 12 s",
    ]
    for _ in progress(iter("abc"), 3, title="a", unit="letter"):
        clock[0] += 0.3
    assert list(progress([], title="b", unit="view")) == []
    assert list(progress("a", title="c", unit="view")) == ["a"]
    assert log() == ["a: 3 of 3 letters, 3.3 letter/s, took 1 s", "c: 1 of 1 view, took 0 s"]


def test_a_loop_left_early_says_how_far_it_came(clock, log):
    def fail():
        for index in progress(range(10), title="fit", unit="step"):
            clock[0] += 0.2
            if index == 4:
                raise ValueError("NaN")

    refused(fail, "NaN", ValueError)
    assert log() == ["fit: 4 of 10 steps, 4.0 step/s, stopped after 1 s"]


def test_terminal_shows_a_bar(monkeypatch):
    stream = Terminal()
    monkeypatch.setattr(sys, "stderr", stream)
    assert list(progress("abc", title="letters", unit="letter")) == ["a", "b", "c"]
    for part in ("letters: 100%", "3/3", "letter/s"):
        assert part in stream.getvalue()


def test_tqdm_is_not_imported_for_a_log_file():
    code = "from texgs.core.progress import progress; list(progress(range(3), title='a', unit='b'))"
    command = [sys.executable, "-c", f"import sys; {code}; sys.exit('tqdm' in sys.modules)"]
    root = Path(__file__).parents[2]
    child = subprocess.run(command, cwd=root, capture_output=True, text=True, check=True)
    assert child.stderr.startswith("a: 3 of 3 bs, ")


def test_a_watch_is_told_of_each_item_and_may_end_the_loop():
    told, seen = [], []

    def watch(title, done, total):
        told.append((title, done, total))
        if done == 2:
            raise RuntimeError("enough")

    with watching(watch), pytest.raises(RuntimeError, match="enough"):
        seen.extend(progress("abc", title="letters", unit="letter"))
    assert told == [("letters", 1, 3), ("letters", 2, 3)]
    assert list(progress("abc", title="letters", unit="letter")) == ["a", "b", "c"]
    assert len(told) == 2
