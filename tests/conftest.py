"""How all tests run: at any speed of the machine, and long files first where several workers share them."""

import ctypes
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from texgs.core.memory import collect_rarely

FOLDER = Path(__file__).parent

# A busy machine is no defect: no example of a property has a time limit.
settings.register_profile(
    "texgs", settings.default, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("texgs")

collect_rarely()

# What takes longest below tests/, the longest first: no worker is left with one of them at the end.
LONG = (
    "test_readme.py",
    "workflow/test_every_rule.py",
    "test_wheel.py",
    "workflow",
    "raster",
    "track",
    "cli",
    "test_benchmarks.py",
)


@pytest.fixture(autouse=True, scope="module")
def memory_given_back():
    """After each file, hand freed memory back: glibc keeps what lies below a block in use, a GB a worker."""
    yield
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim:
        trim(0)


@pytest.hookimpl(tryfirst=True)  # before pytest chooses by marks
def pytest_collection_modifyitems(config, items):
    """Mark what needs a browser. Long files first for workers; one process alone goes on as collected."""
    for item in items:
        if "chromium" in item.fixturenames:
            item.add_marker("browser")
    if config.getoption("numprocesses", None) or hasattr(config, "workerinput"):
        items.sort(key=place)


def place(item):
    """Of a test in the order: that of its file or folder in LONG."""
    return next((i for i, name in enumerate(LONG) if item.path.is_relative_to(FOLDER / name)), len(LONG))
