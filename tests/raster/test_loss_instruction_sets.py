"""Tests of what is not the rasterizer itself, once more on every other instruction set."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from texgs.raster import native

NAMES = (
    "ssim",
    "normals",
    "smoothness",
    "shading",
    "voxels",
    "voxel_optimizer",
    "hash_encoding",
    "convolution",
)
FILES = [str(Path(__file__).with_name(f"test_{name}.py")) for name in NAMES]


@pytest.mark.subprocess
@pytest.mark.parametrize("instruction_set", ["portable", "avx2", "avx512"])
def test_losses_on(instruction_set):
    if instruction_set == native.instruction_set():
        pytest.skip("the tests themselves run on it")
    chosen = "not definition_by_finite and not emulated"
    child = subprocess.run(
        [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-k", chosen, *FILES],
        env={**os.environ, "TEXGS_ISA": instruction_set},
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    if "this machine does not have it" in child.stdout:
        pytest.skip(f"this machine has no {instruction_set}")
    assert child.returncode == 0, child.stdout[-4000:]
