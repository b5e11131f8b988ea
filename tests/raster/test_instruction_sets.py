"""Every instruction set that the library was built for and this machine has computes the same."""

import os
import subprocess
import sys
from dataclasses import asdict
from functools import cache, partial

import numpy as np
import pytest
import torch

from tests.raster.scenes import gaussians, random_scene, textured
from tests.raster.test_determinism import everything
from tests.raster.threads import with_threads
from texgs.core.camera import orbit
from texgs.core.light import Light
from texgs.raster import native
from texgs.volume.caster import OUTPUTS, Caster
from texgs.volume.grid import Grid
from texgs.volume.render import Appearance
from texgs.volume.transfer import TransferFunction

pytestmark = pytest.mark.subprocess

CHILD = """
import sys, torch
from tests.raster.test_instruction_sets import computed
from texgs.raster import native
torch.save((native.instruction_set(), computed()), sys.argv[1])
"""
SETS = ("portable", "avx2", "avx512")
SCENES = {
    "plain": random_scene(1, n=300),
    "textured": textured(random_scene(2)),
    "16 channels": random_scene(3, channels=16),
    "gaussians": gaussians(random_scene(4, n=300)),
    "gaussians, 7 channels": gaussians(random_scene(5, channels=7)),
}


VOLUMES = {  # type of samples, and how many along z, y and x: loads at the ends of rows differ
    "bytes": ("uint8", (14, 9, 3)),
    "signed shorts": ("int16", (3, 2, 5)),
    "floats": ("float32", (33, 33, 33)),
    "long integers": ("uint64", (6, 17, 4)),
}
FUNCTION = TransferFunction(((40, 0), (90, 0.6), (90, 0.2), (255, 0.9)), ((0, 1, 0, 0.5), (255, 0, 1, 0.2)))


def cast_volume(kind, shape):
    """What rays see of a random volume."""
    values = np.random.default_rng(7).integers(0, 256, shape).astype(kind)
    caster = Caster(Grid(values), Appearance(step=0.2, opacity_unit=0.05))
    return asdict(caster.cast(FUNCTION, orbit(-50, 25, 2.5, 30, 37, 29), Light("headlight"), OUTPUTS))


def computed():
    """Everything of each scene and volume; bits must not depend on the number of threads."""
    makers = {name: partial(everything, scene) for name, scene in SCENES.items()}
    makers |= {name: partial(cast_volume, *of) for name, of in VOLUMES.items()}
    results = {}
    for name, make in makers.items():
        results[name] = with_threads(1, make)
        for quantity, value in with_threads(3, make).items():
            assert torch.equal(value, results[name][quantity]), quantity
    return results


def run(instruction_set, folder):
    """Compute in a process of its own, which reads TEXGS_ISA as it loads the library."""
    file = folder / f"{instruction_set}.pt"
    child = subprocess.run(
        [sys.executable, "-c", CHILD, str(file)],
        env={**os.environ, "TEXGS_ISA": instruction_set},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    return child, file


@cache
def portable(folder):
    child, file = run("portable", folder)
    assert child.returncode == 0, child.stderr
    return torch.load(file)[1]


@pytest.mark.parametrize("instruction_set", SETS)
def test_instruction_set(instruction_set, tmp_path_factory):
    folder = tmp_path_factory.getbasetemp()
    child, file = run(instruction_set, folder)
    if "this machine does not have it" in child.stderr:
        pytest.skip(f"this machine has no {instruction_set}")
    assert child.returncode == 0, child.stderr
    used, results = torch.load(file)
    assert used == instruction_set
    for name, expected in portable(folder).items():
        for quantity, value in expected.items():
            # thresholds fall the other way here and there; test_forward.py and test_gradients.py bound them
            scale = value.abs().max().clamp(min=1)
            same = (results[name][quantity] - value).abs() <= 1e-3 * scale
            assert same.double().mean() > 0.995, (name, quantity)


def test_the_best_instruction_set_is_used_by_default():
    if "TEXGS_ISA" in os.environ:
        pytest.skip("TEXGS_ISA is set")
    assert native.instruction_set() in SETS


def test_unknown_instruction_set_is_reported(tmp_path):
    child, _ = run("altivec", tmp_path)
    assert child.returncode != 0
    assert "TEXGS_ISA=altivec: expected avx512, avx2 or portable" in child.stderr
