import contextlib
import subprocess

import pytest

from texgs.core.errors import DeviceError
from texgs.volume import opengl


def answer(monkeypatch, **fields):
    child = subprocess.CompletedProcess([], **({"returncode": 0, "stdout": "", "stderr": ""} | fields))
    monkeypatch.setattr(subprocess, "run", lambda *_args, **_kwargs: child)


def test_the_last_line_of_the_child_names_the_driver(monkeypatch):
    answer(monkeypatch, stdout="noise\nvtkEGLRenderWindow, llvmpipe\n")
    assert opengl.offscreen_opengl() == "vtkEGLRenderWindow, llvmpipe"


@pytest.mark.parametrize(("fields", "reason"), [
    ({"returncode": -11}, "the probe died of signal 11"),
    ({"returncode": 1}, "the probe failed"),
    ({"returncode": 0}, "the probe failed"),
    ({"returncode": 1, "stderr": "Traceback\nlibEGL.so.1: cannot open"}, "libEGL.so.1: cannot open"),
])  # fmt: skip
def test_what_is_wrong_is_said_in_one_sentence(monkeypatch, fields, reason):
    answer(monkeypatch, **fields)
    with pytest.raises(DeviceError) as caught:
        opengl.offscreen_opengl()
    assert str(caught.value) == f"offscreen OpenGL: {reason}; {opengl.ADVICE}"


def test_a_driver_that_hangs_is_given_up(monkeypatch):
    def hang(*_args, **_kwargs):
        raise subprocess.TimeoutExpired("probe", 60)

    monkeypatch.setattr(subprocess, "run", hang)
    with pytest.raises(DeviceError, match="no answer within 60 s; install libegl1"):
        opengl.offscreen_opengl()


def test_without_vtk_every_problem_is_told(monkeypatch):
    def missing(name):
        raise OSError(f"{name} is missing")

    monkeypatch.setattr(opengl.importlib.util, "find_spec", lambda _name: None)
    monkeypatch.setattr(opengl.ctypes, "CDLL", missing)
    monkeypatch.setattr(opengl.sys, "platform", "linux")
    with pytest.raises(OSError, match=r"libEGL\.so\.1 is missing; libOSMesa\.so\.8 is missing"):
        opengl.probe()
    monkeypatch.setattr(opengl.sys, "platform", "darwin")
    assert opengl.probe() == "provided by the system, not tried without VTK"


def test_nothing_of_the_folder_is_run(tmp_path, monkeypatch):
    (tmp_path / "ctypes.py").write_text("from pathlib import Path; Path('was-run').touch()")
    monkeypatch.chdir(tmp_path)
    with contextlib.suppress(DeviceError):  # where nothing renders
        opengl.offscreen_opengl()
    assert not (tmp_path / "was-run").exists()
