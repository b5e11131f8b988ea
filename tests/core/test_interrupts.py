"""Ctrl-C waits for a place where it breaks nothing."""

import signal
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest

from texgs.core.interrupts import interrupts_between_items
from texgs.core.progress import progress


def ctrl_c():
    signal.raise_signal(signal.SIGINT)


@pytest.fixture(autouse=True)
def _handler_stays():
    """That of Python, which has none where SIGINT is ignored, as in a job started in the background."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    assert signal.signal(signal.SIGINT, before) is signal.default_int_handler


def a_loop(done):
    for item in progress(range(9), title="loop", unit="item"):
        if item == 3:
            ctrl_c()
        done.append(item)


def no_loop(done):
    ctrl_c()
    done.append("end")


def twice(done):
    ctrl_c()
    done.append("first")
    ctrl_c()
    done.append("second")


@pytest.mark.parametrize(
    ("work", "expected"), [(a_loop, [0, 1, 2, 3]), (no_loop, ["end"]), (twice, ["first"])]
)
def test_it_comes_at_the_next_item_at_the_end_or_the_second_time_at_once(work, expected):
    done = []
    with pytest.raises(KeyboardInterrupt), interrupts_between_items():
        work(done)
    assert done == expected


def test_packages_are_imported_as_a_whole(tmp_path, monkeypatch):
    """Else the package is gone, but not its module that was there, which nothing binds to the new one."""
    package = tmp_path / "halved"
    package.mkdir()
    again = "import halved.part\nimport signal\nsignal.raise_signal(signal.SIGINT)\nwhole = halved.part.one\n"
    (package / "__init__.py").write_text(again)
    (package / "part.py").write_text("one = 1\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(KeyboardInterrupt), interrupts_between_items():
        import halved
    assert sys.modules["halved"].whole == 1
    assert halved.part.one == 1


def test_what_goes_wrong_is_told_and_other_threads_are_left_alone():
    with pytest.raises(ValueError, match="wrong"), interrupts_between_items():
        raise ValueError("wrong")
    work = interrupts_between_items()(lambda: signal.getsignal(signal.SIGINT))
    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(work).result() == signal.getsignal(signal.SIGINT)
