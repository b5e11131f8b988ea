"""The CUDA library compiled for the CPU, in place of the CPU library while a test runs."""

from __future__ import annotations

import ctypes
import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from unittest.mock import patch

import torch
from filelock import FileLock

from texgs.raster import native
from texgs.workflow.code import library_sources

SOURCE = Path(__file__).parent
BUILD = SOURCE.parents[1] / "build" / "cuda_emulation"
MACHINES = ("x86_64", "aarch64")


def missing() -> str | None:
    """What the emulation lacks on this machine; None where it can run."""
    if sys.platform != "linux" or platform.machine() not in MACHINES:
        return "the emulation of CUDA needs Linux on x86-64 or ARM"
    if not _program("cmake") or not shutil.which("g++"):
        return "the emulation of CUDA needs cmake and g++ to compile the kernels"
    return None


def _program(name: str) -> str | None:
    """A program of this environment, or else of the machine."""
    return shutil.which(name, path=os.pathsep.join((str(Path(sys.executable).parent), os.environ["PATH"])))


@cache
def build() -> Path:
    """Compile the libraries, or what has changed of them; the folder they are in."""
    BUILD.mkdir(parents=True, exist_ok=True)
    cmake, ninja = _program("cmake"), _program("ninja")
    generator = ["-G", "Ninja", f"-DCMAKE_MAKE_PROGRAM={ninja}"] if ninja else []
    options = ["-DCMAKE_CXX_COMPILER=g++", f"-DTEXGS_SOURCES={library_sources()}", *generator]
    configure = [cmake, "-S", SOURCE, "-B", BUILD, *options]
    with FileLock(BUILD / "lock"):
        for command in (configure, [cmake, "--build", BUILD, "--parallel", "2"]):
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            assert done.returncode == 0, done.stdout + done.stderr
    return BUILD


@cache
def library() -> ctypes.CDLL:
    """The emulated library, described to ctypes as the others are."""
    with patch.object(native, "library_path", lambda device_type: build() / "libtexgs_cuda_emulated.so"):
        lib = native.library.__wrapped__("cuda")
    describe(lib)
    return lib


def describe(lib: ctypes.CDLL) -> None:
    """Describe what the emulation adds to a library."""
    lib.emulation_seed.argtypes = [ctypes.c_uint64]
    lib.emulation_synchronize.restype = ctypes.c_char_p


def synchronize(lib: ctypes.CDLL) -> None:
    """Wait for all work.

    Raises:
        AssertionError: if a kernel did what a GPU would get wrong.
    """
    if report := lib.emulation_synchronize():
        raise AssertionError(f"CUDA kernel, {report.decode()}")


def _call(name: str, *arguments: object, device: torch.device) -> None:
    lib = library()
    status = native.function(lib, name)(*map(native.as_ctypes, arguments), None)
    synchronize(lib)
    native._require_success(status, lib, device)


@contextmanager
def emulated_cuda(seed: int) -> Iterator[None]:
    """Let the emulated kernels work on CPU tensors, in the order that `seed` stands for."""
    lib = library()
    lib.emulation_seed(seed)
    with patch.object(native, "library", lambda device_type="cpu": lib), patch.object(native, "call", _call):
        yield
