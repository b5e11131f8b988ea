"""Fits in the kernel of a notebook that are interrupted, also in the middle of an import."""

import os
import sys
from pathlib import Path

import pytest
from jupyter_client.manager import start_new_kernel

from texgs.core.cache import sha256
from texgs.workflow.result import FILES, file_checksums

SECONDS = 300  # of a cell, on a machine that has much else to do
BEFORE = """
import signal, sys
import numpy as np
import texgs

x, y, z = np.meshgrid(*[np.linspace(-1, 1, 20)] * 3, indexing="ij")
volume = texgs.Volume(np.sqrt(np.maximum(0, 1 - x * x - y * y - z * z)).astype(np.float32), name="ball")
function = texgs.TransferFunction([[0.6, 0.0], [0.8, 0.5], [1.0, 0.5]], [[0.8, 0.9, 0.5, 0.1]])
few = ("views.train.frequency=1", "fit.shading.iterations=400", "views.step=1")

class InImport:
    def find_spec(self, name, path=None, target=None):
        # The first phase imports it; the packages above are there by then.
        if name == "texgs.fitting.loop":
            sys.meta_path.remove(self)
            signal.raise_signal(signal.SIGINT)

sys.meta_path.insert(0, InImport())
"""
FIT = "scene = texgs.fit(volume, function, size=32, overrides=few, folder='fit')"


@pytest.fixture
def kernel(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}:{os.environ['PATH']}")
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    manager, client = start_new_kernel(cwd=str(tmp_path))
    yield manager, client
    client.stop_channels()
    manager.shutdown_kernel(now=True)


def run(kernel, code, until=None):
    """Run a cell, interrupt it once when a bar shows a text, and return its error and what it has printed."""
    manager, client = kernel
    shown, bars = [], []

    def hear(message):
        said = message["content"]
        shown.append(said.get("text", ""))
        bars.append(said.get("data", {}).get("text/plain", ""))
        if until and until in bars[-1] and until not in "".join(bars[:-1]):
            manager.interrupt_kernel()

    reply = client.execute_interactive(code, output_hook=hear, timeout=SECONDS)["content"]
    return reply.get("ename"), "".join(shown)


def whole(folder):
    """The names of all results of jobs, whose files are as their checksums say."""
    results = [path.parent for path in folder.rglob(FILES) if not path.parent.name.endswith(".work")]
    for result in results:
        assert all(sha256(result / name) == known for name, known in file_checksums(result).items())
    return {result.name for result in results}


@pytest.mark.docs
def test_an_interrupted_fit_leaves_a_kernel_and_a_folder_to_go_on_with(kernel, tmp_path):
    quick = tmp_path / "fit" / "ball" / "TF01" / "quick"
    assert run(kernel, BEFORE) == (None, "")
    assert run(kernel, FIT)[0] == "KeyboardInterrupt"  # in the import
    assert run(kernel, "print('next', 'scene' in globals())") == (None, "next False\n")
    assert run(kernel, FIT, until="shading:")[0] == "KeyboardInterrupt"
    before = (quick / "surfels" / "model.safetensors").stat().st_mtime_ns
    assert run(kernel, "print('next', 'scene' in globals())") == (None, "next False\n")
    assert whole(tmp_path / "fit") == {"volume", "views", "surfels"}
    assert run(kernel, FIT)[0] is None
    assert run(kernel, "print(scene.psnr(views=2, width=24) > 15)") == (None, "True\n")
    assert (quick / "surfels" / "model.safetensors").stat().st_mtime_ns == before
    assert whole(tmp_path / "fit") == {"volume", "views", "surfels", "shading", "texture", "compose"}
    assert not [*(tmp_path / "fit").rglob("*.work")]
