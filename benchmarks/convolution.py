"""Features of VGG-16 and their gradient: texgs's convolutions on CPUs beside those of torch."""

from itertools import pairwise

import torch
from torch import Tensor

from benchmarks.report import Section
from benchmarks.settings import Settings
from benchmarks.timing import Case, measure
from texgs.core.memory import keep_freed_memory
from texgs.models.networks import fast_dtype
from texgs.models.vgg import STYLE_LAYERS, Vgg, by_torch, channels, rectified_convolution

LAYERS = ("relu1_1", "relu1_2", "relu2_1", "relu2_2", *STYLE_LAYERS)


def run(settings: Settings) -> Section:
    """Time the layers that styles are compared by; the weights are random, which takes as long."""
    section = Section()
    if settings.device.type != "cpu":
        section.skip("features of VGG-16", "on GPUs, torch computes them")
        return section
    keep_freed_memory()  # as the command line does
    networks = {"texgs": random_vgg(settings.device, torch.float32)}
    for dtype in dict.fromkeys((torch.float32, fast_dtype(settings.device))):
        name = f"torch, {str(dtype).removeprefix('torch.')}"
        networks[name] = random_vgg(settings.device, dtype, is_torch=True)
    for size in settings.sizes:
        cases = [pair(network, {"size": size, "by": name}) for name, network in networks.items()]
        section.measurements += measure(cases, settings.rounds, settings.device, "convolution")
    section.add_ratios("by", "texgs", ["features"], "time")
    return section


def pair(network: Vgg, where: dict[str, object]) -> Case:
    """Features of an image, then the gradient of some of them."""
    size = where["size"]
    image = torch.rand(3, size, size, generator=torch.Generator().manual_seed(0)).requires_grad_()
    features: list[Tensor] = []

    def forward() -> None:
        features[:] = network.layers(image[None])

    def backward() -> None:
        torch.autograd.grad(features, image, list(map(torch.ones_like, features)))

    return Case("features", where, {"forward": forward, "backward": backward})


def random_vgg(device: torch.device, dtype: torch.dtype, is_torch: bool = False) -> Vgg:
    """A network of the right size whose activations keep theirs."""
    generator, convolutions = torch.Generator().manual_seed(0), []
    for inputs, outputs in pairwise([3, *map(channels, LAYERS)]):
        weight = (2 / (9 * inputs)) ** 0.5 * torch.randn(outputs, inputs, 3, 3, generator=generator)
        bias = torch.zeros(outputs, device=device, dtype=dtype)
        convolve = by_torch if is_torch else rectified_convolution
        convolutions.append(convolve(weight.to(device, dtype), bias))
    return Vgg(tuple(convolutions), LAYERS, STYLE_LAYERS, dtype)
