"""Which CUDA library CMake builds: for a GPU that is seen, for all on request, else none, with a word."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
pytestmark = [
    pytest.mark.packaging,
    pytest.mark.skipif(not (shutil.which("nvcc") and shutil.which("cmake")), reason="needs nvcc and cmake"),
]


def configured(folder, listed, *options, status=0):
    """What the cache and the build files say where nvidia-smi lists this, and ends with a status."""
    smi = folder / "nvidia-smi"
    smi.write_text(f"#!/bin/sh\nprintf '{listed}'\nexit {status}\n")
    smi.chmod(0o755)
    command = ["cmake", "-S", ROOT, "-B", folder / "build", f"-DPython_EXECUTABLE={sys.executable}"]
    command += ["-DCMAKE_EXPORT_COMPILE_COMMANDS=ON", "-DTEXGS_IN_PLACE=OFF", *options]
    path = f"{folder}:{os.environ['PATH']}"
    subprocess.run(command, check=True, env={**os.environ, "PATH": path}, capture_output=True)
    said = (folder / "build" / "CMakeCache.txt").read_text()
    (left_out,) = re.findall(r"^TEXGS_LEFT_OUT:INTERNAL=(.*)", said, re.MULTILINE)
    commands = (folder / "build" / "compile_commands.json").read_text()
    return left_out, set(re.findall(r",code=\[?([^\]\\\"]*)", commands))


def test_no_gpu_no_cuda(tmp_path):
    left_out, codes = configured(tmp_path, "")
    assert left_out == "nvidia-smi lists no GPU of compute capability 8.0 or newer"
    assert not codes


def test_a_driver_that_does_not_work_is_no_gpu(tmp_path):
    left_out, codes = configured(tmp_path, "NVML library version: 535.161\n", status=18)
    assert left_out == "nvidia-smi lists no GPU of compute capability 8.0 or newer"
    assert not codes


def test_an_old_gpu_is_none(tmp_path):
    assert configured(tmp_path, "7.5\\n")[0]


def test_for_the_gpus_that_are_seen(tmp_path):
    assert configured(tmp_path, "9.0\\n8.6\\n9.0\\n") == ("", {"sm_90", "sm_86"})


@pytest.mark.parametrize(("listed", "options"), [("99.9\\n", []), ("", ["-DTEXGS_CUDA=ON"])])
def test_for_all_on_request_and_where_the_compiler_does_not_know_the_gpu(tmp_path, listed, options):
    left_out, codes = configured(tmp_path, listed, *options)
    assert not left_out
    assert codes == {"sm_80", "compute_90,sm_90"}
