"""Ctrl-C waits for a place where it breaks nothing."""

import signal
import sys
from threading import Thread

import pytest

from texgs.core.progress import interrupts_between_items, progress


def ctrl_c():
    signal.raise_signal(signal.SIGINT)


@pytest.fixture(autouse=True)
def _handler_stays():
    """That of Python, which has none where SIGINT is ignored, as in a job started in the background."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    assert signal.signal(signal.SIGINT, before) is signal.default_int_handler


def test_it_ends_a_loop_at_its_next_item():
    done = []

    @interrupts_between_items()
    def work():
        for item in progress(range(9), title="loop", unit="item"):
            if item == 3:
                ctrl_c()
            done.append(item)

    with pytest.raises(KeyboardInterrupt):
        work()
    assert done == [0, 1, 2, 3]


def test_without_a_loop_it_comes_at_the_end():
    done = []

    @interrupts_between_items()
    def work():
        ctrl_c()
        done.append(1)

    with pytest.raises(KeyboardInterrupt):
        work()
    assert done == [1]


def test_the_second_comes_at_once():
    done = []

    @interrupts_between_items()
    def work():
        ctrl_c()
        done.append(1)
        ctrl_c()
        done.append(2)

    with pytest.raises(KeyboardInterrupt):
        work()
    assert done == [1]


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
    done = []

    @interrupts_between_items()
    def work():
        done.append(signal.getsignal(signal.SIGINT))

    thread = Thread(target=work)
    thread.start()
    thread.join()
    assert done == [signal.getsignal(signal.SIGINT)]
