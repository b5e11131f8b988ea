"""Random weights in the format of torchvision's VGG-16, and that network built of modules."""

import pytest
import torch
from torch import nn

from texgs.models.vgg import Vgg

LAYOUT = (64, 64, "M", 128, 128, "M", 256, 256, 256, "M", 512, 512, 512, "M", 512, 512, 512)


def features():
    """The list of modules that torchvision calls `features`."""
    modules, inputs = [], 3
    for width in LAYOUT:
        if width == "M":
            modules.append(nn.MaxPool2d(2))
        else:
            modules += [nn.Conv2d(inputs, width, 3, padding=1), nn.ReLU()]
            inputs = width
    return nn.Sequential(*modules)


def random_weights(seed=0, last=None):
    """Tensors by name, with activations that neither vanish nor explode; up to module `last`."""
    generator = torch.Generator().manual_seed(seed)
    weights = {}
    for name, shape in ((name, x.shape) for name, x in features().state_dict().items()):
        if last is None or int(name.split(".")[0]) <= last:
            fan = shape[1] * 9 if len(shape) == 4 else 1
            scale = (2 / fan) ** 0.5 if len(shape) == 4 else 0.1
            weights[f"features.{name}"] = scale * torch.randn(shape, generator=generator)
    return weights


def outputs(x, wanted):
    """Outputs in float64 of modules of torchvision's list, by index, with the random weights."""
    modules, found = features().double(), []
    modules.load_state_dict({name.removeprefix("features."): w for name, w in random_weights().items()})
    x = x.double()
    for index, module in enumerate(modules[: max(wanted) + 1]):
        x = module(x)
        found += [x] if index in wanted else []
    return found


@pytest.fixture(scope="module")
def vgg(tmp_path_factory):
    """A VGG with random weights up to block 3."""
    path = tmp_path_factory.mktemp("vgg") / "vgg.pth"
    torch.save(random_weights(last=14), path)
    return Vgg.load(path, dtype=torch.float32)
