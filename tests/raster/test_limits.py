"""Large scenes work within bounded memory; a library that does not fit, or what cannot fit, is told."""

import _ctypes
import math
import re
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from benchmarks.scenes import camera, surfels
from tests.raster.closed_form import view
from tests.raster.scenes import Scene, random_scene
from tests.refusals import refused
from texgs.core.errors import DeviceError, NativeError, OutOfMemoryError
from texgs.raster import native
from texgs.raster.api import rasterize
from texgs.raster.arguments import MAX_SIDE

GB = 1e9


def generated(kind, n, width, height):
    """A benchmark scene; the view is as high as wide and cropped or padded to the size."""
    view = camera(height)
    K = view.K.clone()
    K[0, 2] = width / 2
    return Scene(**surfels(kind, n), viewmat=view.viewmat, K=K, width=width, height=height)


@pytest.mark.large
def test_a_million_surfels(device):
    scene = generated("light", 1_000_000, 1920, 1080).to(device)
    leaves = {name: leaf.requires_grad_() for name, leaf in scene.leaves().items()}
    if device.type == "cpu":
        native.peak_memory(reset=True)
    render = scene.with_leaves(leaves).render(rasterize)
    gradients = torch.autograd.grad(render.color.square().sum(), list(leaves.values()))
    assert (render.alpha > 0.9).double().mean() > 0.2
    assert all(gradient.isfinite().all() for gradient in gradients)
    if device.type == "cpu":
        assert native.peak_memory() < 4 * GB


def test_memory_of_a_usual_scene(drawn):
    scene = drawn(generated("opaque", 60_000, 800, 800))
    leaves = {name: leaf.requires_grad_() for name, leaf in scene.leaves().items()}
    native.release_memory()  # what larger views left
    native.peak_memory(reset=True)
    torch.autograd.grad(scene.with_leaves(leaves).render(rasterize).color.sum(), list(leaves.values()))
    assert native.peak_memory() < 0.5 * GB
    native.release_memory()
    native.peak_memory(reset=True)
    assert native.peak_memory() == 0


@pytest.mark.parametrize("size", [(1_000_000, 1_000_000), (MAX_SIDE, MAX_SIDE)])
def test_images_that_cannot_fit(device, size):
    scene = replace(random_scene(), width=size[0], height=size[1]).to(device)
    with pytest.raises(OutOfMemoryError, match=r"\d+ bytes") as raised:
        scene.render(rasterize)
    needed = int(re.search(r"(\d+) bytes", str(raised.value))[1])
    assert needed >= 4 * 4 * size[0] * size[1]  # colour and alpha alone


@pytest.mark.large
@pytest.mark.parametrize("axis", [0, 1], ids=["widest", "highest"])
def test_the_longest_image(device, axis):
    """Its tiles are the most that the library can count: one more, and the surfel would be nowhere."""
    size = [1, 1]
    size[axis] = MAX_SIDE
    given = view(means=[[0, 0, 1]], scales=[[MAX_SIDE / 2] * 2], opacities=[0.9])  # ends are one sigma away
    given |= {"K": torch.tensor([[1.0, 0, size[0] / 2], [0, 1, size[1] / 2], [0, 0, 1]])}
    given = {name: x.float().to(device) for name, x in given.items() if name not in ("width", "height")}
    shown = rasterize(**given, features=torch.ones(1, 1, device=device), width=size[0], height=size[1])
    alpha, expected = shown.alpha.flatten().cpu(), 0.9 * math.exp(-0.5)
    assert float(alpha[0]) == pytest.approx(expected, abs=1e-3)
    assert float(alpha[-1]) == pytest.approx(expected, abs=1e-3)
    assert float(alpha.min()) > 0.54
    assert float(alpha[MAX_SIDE // 2]) == pytest.approx(0.9, abs=1e-3)


def test_surfels_that_cannot_fit():
    many = 10**12  # tensors of no memory: one surfel repeated
    leaves = {name: x[:1].expand(many, *x.shape[1:]) for name, x in random_scene().leaves().items()}
    refused(lambda: random_scene().with_leaves(leaves).render(rasterize), r"\d+ bytes", OutOfMemoryError)


@pytest.mark.parametrize(
    ("content", "device", "named"),
    [
        (None, "cpu", r"libtexgs\.so: not found"),
        (None, "cuda", "with nvcc 12 or newer: `make install CUDA=1`, or .*"),
        (b"not a library", "cpu", r"libtexgs\.so: cannot be loaded"),
        (Path(_ctypes.__file__), "cpu", "no function texgs_abi_version"),  # a library of others
    ],
)
def test_a_library_that_is_not_ours(monkeypatch, tmp_path, content, device, named):
    path = tmp_path / "libtexgs.so"
    if content is not None:
        path.write_bytes(content if isinstance(content, bytes) else content.read_bytes())
    monkeypatch.setattr(native, "library_path", lambda device_type: path)
    refused(lambda: native.library.__wrapped__(device), f"{named}.*install", NativeError)


def test_a_function_and_a_device_that_the_library_does_not_have():
    refused(lambda: native.call("texgs_paint", device=torch.device("cpu")), "texgs_paint", NativeError)
    refused(lambda: native.library("meta"), "cpu or cuda, got meta", DeviceError)


def test_out_of_memory_on_a_gpu_tells_of_what_torch_keeps(monkeypatch):
    def require(device):
        return lambda: native.require_memory(2**60, torch.device(device), "images", "choose smaller ones")

    refused(require("cpu"), r"needs \d+ bytes more$", OutOfMemoryError)
    library = native.library()
    monkeypatch.setattr(native, "library", lambda device_type: library)
    monkeypatch.setattr(torch.cuda, "device", lambda device: nullcontext())
    refused(require("cuda"), r"torch\.cuda\.empty_cache\(\)", OutOfMemoryError)
