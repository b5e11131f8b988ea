"""Every instruction set that the library was built for, and this machine has, passes the kernels' tests."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from texgs.raster import native

pytestmark = pytest.mark.subprocess

TESTS = Path(__file__).parents[1]
KERNELS = ("operations", "losses", "shading", "voxels", "voxel_grid", "convolution")
FILES = [
    *(TESTS / "raster" / f"test_{name}.py" for name in (*KERNELS, "images_and_gradients")),
    *(TESTS / "volume" / f"test_{name}.py" for name in ("caster", "cuts", "lookup", "light_devices")),
]
# Without what computes the same on all of them; of random scenes, whose float64 definition takes long, those
# with all images, with numbers of channels that fill no vector, and with all that a texture can have.
CHOSEN = (
    "not finite_differences and not emulated and not large and not cuda and not cells and not memory"
    " and (not test_images_and_gradients or all or behind or mixed or frozen or 7 or 29)"
)


def run(instruction_set, *command):
    """Run Python in a process of its own, which reads TEXGS_ISA as it loads the library."""
    return subprocess.run(
        [sys.executable, *command],
        env={**os.environ, "TEXGS_ISA": instruction_set},
        cwd=TESTS.parent,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )


@pytest.mark.parametrize("instruction_set", ["portable", "avx2", "avx512"])
def test_instruction_set(instruction_set):
    if instruction_set == native.instruction_set():
        pytest.skip("the tests themselves run on it")
    child = run(
        instruction_set, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-k", CHOSEN, *map(str, FILES)
    )
    if "this machine does not have it" in child.stdout:
        pytest.skip(f"this machine has no {instruction_set}")
    assert child.returncode == 0, child.stdout[-4000:]


def test_an_instruction_set_is_chosen_or_refused():
    say = "from texgs.raster import native; print(native.instruction_set())"
    assert run("portable", "-c", say).stdout.strip() == "portable"
    assert "TEXGS_ISA=altivec: expected avx512, avx2 or portable" in run("altivec", "-c", say).stderr
