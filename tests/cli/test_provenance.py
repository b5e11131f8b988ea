"""Which device a job names: the one that did its work."""

import sys
from types import SimpleNamespace

import pytest

from texgs.workflow.provenance import device, seed


class Cuda:
    """A CUDA that a job has used, or has not."""

    def __init__(self, is_used):
        self.is_initialized = lambda: is_used
        if is_used:
            self.get_device_name = lambda: "H200"  # elsewhere torch has no name to tell


@pytest.mark.parametrize(
    ("settings", "is_used", "expected"),
    [
        ({"fit": {"device": "cuda"}}, True, "H200"),
        ({"fit": {"device": "cuda"}}, False, "CPU"),
        ({"fit": {"device": "cpu"}, "views": {"mapper": "gpu"}}, True, "CPU"),
        ({"fit": {"device": "cpu"}, "views": {"mapper": "vtk"}}, False, "CPU"),
        ({"views": {"mapper": "gpu"}}, True, "H200"),
        ({"views": {"mapper": "vtk"}}, False, "VTK"),
        ({"views": {"mapper": "cpu"}}, False, "CPU"),
        ({}, False, "CPU"),
    ],
)
def test_the_device_is_what_showed_the_scene(monkeypatch, settings, is_used, expected):
    monkeypatch.setitem(sys.modules, "torch", SimpleNamespace(cuda=Cuda(is_used)))
    assert device(settings).split()[-1] == expected


def test_the_seed_of_a_page_is_that_of_its_look():
    page = {"look_seed": 3, "fit": {"seed": 1}}
    assert seed({**page, "look": "gold"}) == 3
    assert seed({**page, "look": "none"}) == 1
