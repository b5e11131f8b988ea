"""Files of weights, formats of numbers, and VGG-16 against torchvision's list of modules."""

from pathlib import Path

import pytest
import torch
from safetensors.torch import save_file
from torch.testing import assert_close

from tests.models.networks import outputs, random_weights
from tests.real_data import real_data
from tests.refusals import refused
from texgs.core.errors import ShapeError
from texgs.models import networks
from texgs.models.networks import read_tensors
from texgs.models.vgg import Vgg


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("processor : 0\nflags\t\t: fpu avx512f avx512_bf16 amx_tile\n", torch.bfloat16),
        ("Features : asimd sve bf16\n", torch.bfloat16),
        ("flags : fpu avx2 avx512f\nbugs : bf16\n", torch.float32),
        ("", torch.float32),
    ],
)
def test_the_format_is_what_the_processor_says(tmp_path, monkeypatch, text, expected):
    (tmp_path / "cpuinfo").write_text(text)
    monkeypatch.setattr(networks, "CPUINFO", tmp_path / "cpuinfo")
    networks.has_bfloat16.cache_clear()
    assert networks.fast_dtype("cpu") == expected
    assert networks.fast_dtype(torch.device("cuda")) == torch.float16
    monkeypatch.setattr(networks, "CPUINFO", tmp_path / "none")
    networks.has_bfloat16.cache_clear()
    assert networks.fast_dtype("cpu") == torch.float32
    networks.has_bfloat16.cache_clear()


def test_only_the_tensors_asked_for_come_back(tmp_path):
    tensors = {"a": torch.arange(3.0), "b": torch.ones(2, 2)}
    save_file(tensors, tmp_path / "x.safetensors")
    torch.save(tensors, tmp_path / "x.pth")
    torch.save(tensors, tmp_path / "old.pth", _use_new_zipfile_serialization=False)
    for name in ("x.safetensors", "x.pth", "old.pth"):
        assert read_tensors(tmp_path / name).keys() == tensors.keys()
        read = read_tensors(tmp_path / name, ["b"])
        assert list(read) == ["b"]
        assert torch.equal(read["b"], tensors["b"])
        refused(lambda name=name: read_tensors(tmp_path / name, ["b", "c"]), f"{name}: .* tensor c")


class Harmful:
    def __reduce__(self):
        return (Path.touch, (Path("harm"),))


def test_a_damaged_file_and_one_that_holds_code_are_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    torch.save({"a": torch.ones(1000), "b": Harmful()}, tmp_path / "code.pth")
    torch.save({"a": torch.ones(1000)}, tmp_path / "x.pth")
    save_file({"a": torch.ones(1000)}, tmp_path / "x.safetensors")
    bad = [tmp_path / "code.pth"]
    for path in (tmp_path / "x.pth", tmp_path / "x.safetensors"):
        whole = path.read_bytes()
        for kind, content in (
            ("cut", whole[: len(whole) // 2]),
            ("text", b"<html>not found</html>"),
            ("empty", b""),
        ):
            bad.append(path.with_stem(kind))
            bad[-1].write_bytes(content)
    for path in bad:
        refused(lambda path=path: read_tensors(path), f"{path}: expected a file of weights")
    assert not Path("harm").exists()
    refused(lambda: read_tensors(tmp_path / "gone.pth"), r"gone\.pth: no such file")


STYLE = {11: "relu3_1", 13: "relu3_2", 15: "relu3_3"}  # by index of the module in torchvision's list


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """The same weights in both formats; as far as the style needs them."""
    folder = tmp_path_factory.mktemp("vgg")
    weights = random_weights(last=14)
    save_file({name: x.contiguous() for name, x in weights.items()}, folder / "vgg.safetensors")
    torch.save(weights, folder / "vgg.pth")
    return folder


def expected(image, wanted):
    """Outputs of torchvision's modules for an image in [0, 1]."""
    mean, deviation = torch.tensor([0.485, 0.456, 0.406]), torch.tensor([0.229, 0.224, 0.225])
    return outputs(((image - mean[:, None, None]) / deviation[:, None, None])[None], wanted)


@pytest.mark.parametrize("name", ["vgg.safetensors", "vgg.pth"])
def test_features_are_those_of_torchvisions_modules(files, name):
    image = torch.rand(3, 41, 30)
    network = Vgg.load(files / name, dtype=torch.float32)
    truth = torch.cat(expected(image, STYLE), dim=1)[0]
    maps = network.features(image)
    assert maps.shape == (768, 10, 7)
    assert_close(maps.double(), truth, rtol=1e-4, atol=1e-4)


def test_bfloat16_is_close_and_has_gradients(files):
    image = torch.rand(3, 32, 32, requires_grad=True)
    truth = torch.cat(expected(image.detach(), STYLE), dim=1)[0]
    maps = Vgg.load(files / "vgg.pth", dtype=torch.bfloat16).features(image)
    assert maps.dtype == torch.bfloat16
    assert torch.cosine_similarity(maps.double(), truth, dim=0).min() > 0.999
    (gradient,) = torch.autograd.grad(maps.float().square().mean(), image)
    exact = image.detach().clone().requires_grad_()
    network = Vgg.load(files / "vgg.pth", dtype=torch.float32)
    (other,) = torch.autograd.grad(network.features(exact).square().mean(), exact)
    assert torch.cosine_similarity(gradient.flatten(), other.flatten(), dim=0) > 0.99


def test_layers_of_several_blocks_come_one_by_one_or_joined_by_their_stride(files):
    names, image = ("relu1_2", "relu2_2"), torch.rand(3, 16, 24)
    network = Vgg.load(files / "vgg.pth", layers=names, dtype=torch.float32)
    assert len(network.convolutions) == 4, "no more is read than needed"
    layers = [x[0] for x in network.layers(image[None])]
    for layer, truth in zip(layers, expected(image, (3, 8)), strict=True):
        assert_close(layer.double(), truth[0], rtol=1e-4, atol=1e-4)
    network = Vgg.load(files / "vgg.pth", dtype=torch.float32)
    blocks = network.blocks(image, (*names, *STYLE.values()))
    assert {stride: x.shape for stride, x in blocks.items()} == {
        1: (64, 16, 24),
        2: (128, 8, 12),
        4: (768, 4, 6),
    }
    joined = [*(x[0] for x in network.layers(image[None], names)), network.features(image)]
    assert_close([blocks[1], blocks[2], blocks[4]], joined, rtol=0, atol=0)


def test_weights_of_something_else_are_refused(tmp_path):
    weights = random_weights(last=14)
    torch.save({name: x for name, x in weights.items() if "14" not in name}, tmp_path / "short.pth")
    refused(lambda: Vgg.load(tmp_path / "short.pth"), r"short\.pth: .* features\.14\.weight")
    torch.save({**weights, "features.5.weight": torch.ones(128, 32, 3, 3)}, tmp_path / "other.pth")
    refused(lambda: Vgg.load(tmp_path / "other.pth"), r"other\.pth: features\.5\.weight", ShapeError)


def test_real_weights_tell_an_edge_from_noise():
    network = Vgg.load(real_data("weights") / "vgg16_features_fp16.safetensors", dtype=torch.float32)
    stripes = torch.arange(64).div(4, rounding_mode="floor").remainder(2).float().expand(3, 64, 64)
    noise = torch.rand(2, 3, 64, 64)
    a, b, c = (network.features(x).mean(dim=(1, 2)) for x in (*noise, stripes))
    assert torch.cosine_similarity(a, b, dim=0) > torch.cosine_similarity(a, c, dim=0) + 0.2
