"""VGG-16 up to the last layer needed."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import EllipsisType
from typing import Self

import torch
from torch import Tensor
from torch.nn import functional as F

from texgs.core import check
from texgs.models.networks import read_tensors
from texgs.models.weights import locate
from texgs.raster.convolution import RectifiedConvolution

MEAN, DEVIATION = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)  # of ImageNet, per channel
BLOCKS = (2, 2, 3, 3, 3)  # convolutions before each pooling
CHANNELS = (64, 128, 256, 512, 512)  # in each block
Box = tuple[EllipsisType | slice, ...]  # rows and columns of an image
STYLE_LAYERS = ("relu3_1", "relu3_2", "relu3_3")  # 3 x 256 channels, a quarter of the resolution


@dataclass(frozen=True, eq=False)
class Vgg:
    """Frozen convolutions up to the last wanted layer."""

    convolutions: tuple[Callable[[Tensor], Tensor], ...]  # each with its rectifier
    names: tuple[str, ...]  # of the layers, such as relu3_1
    wanted: tuple[str, ...]
    dtype: torch.dtype  # of the computation

    @classmethod
    def load(
        cls,
        path: str | Path | None = None,
        device: torch.device | str = "cpu",
        layers: Sequence[str] = STYLE_LAYERS,
        dtype: torch.dtype | None = None,
    ) -> Self:
        """Read the weights for some layers, `relu1_1` to `relu5_3` in order.

        They have torchvision's names, `features.N.weight`. The dtype to compute in is by default the fastest:
        float16 on a GPU, and float32 on a CPU, where convolutions are by Winograd's algorithm.
        """
        path = locate("vgg16") if path is None else path
        names = [f"relu{b + 1}_{c + 1}" for b, count in enumerate(BLOCKS) for c in range(count)]
        names = names[: names.index(layers[-1]) + 1]
        keys = [f"features.{place(name)}" for name in names]
        stored = read_tensors(path, [f"{key}.{kind}" for key in keys for kind in ("weight", "bias")])
        if dtype is None:
            dtype = torch.float16 if torch.device(device).type == "cuda" else torch.float32
        for key, name, before in zip(keys, names, [None, *names], strict=False):
            inputs = 3 if before is None else channels(before)
            check.shape(f"{path}: {key}.weight", stored[f"{key}.weight"], f"{channels(name)} {inputs} 3 3")
        convolutions = [
            rectified_convolution(*(stored[f"{key}.{kind}"].to(device, dtype) for kind in ("weight", "bias")))
            for key in keys
        ]
        return cls(tuple(convolutions), tuple(names), tuple(layers), dtype)

    def layers(self, images: Tensor, wanted: Sequence[str] | None = None) -> list[Tensor]:
        """Return outputs [N, C, H/s, W/s] of some layers, s = 1, 2, 4 ... by block; differentiable.

        Images [N, 3, H, W] are red, green and blue in [0, 1]. Layers are named up to the last one that was
        loaded, in order; by default those loaded for.
        """
        x, features = self.prepared(images), []
        wanted = self.wanted if wanted is None else wanted
        last = self.names.index(wanted[-1]) + 1
        for name, convolve in zip(self.names[:last], self.convolutions, strict=False):
            if name.endswith("_1") and name != "relu1_1":
                x = F.max_pool2d(x, 2)
            x = convolve(x)
            if name in wanted:
                features.append(x)
        return features

    def prepared(self, images: Tensor) -> Tensor:
        """Normalise images [N, 3, H, W] in [0, 1] for the first convolution."""
        from kornia.enhance import normalize

        check.shape("images", images, "N 3 H W")
        x = normalize(images, torch.tensor(MEAN), torch.tensor(DEVIATION))
        return x.to(self.dtype, memory_format=torch.channels_last)

    def changed(
        self, layers: Mapping[str, Tensor], image: Tensor, where: Tensor
    ) -> Iterator[tuple[str, Box, Tensor]]:
        """Yield the part of each block's last layer that differs from a known one, and its values.

        It is that of an image [1, 3, H, W], which differs from the known one in some pixels [H, W] at most.
        What is given and yielded are outputs [1, C, h, w] by name. Not differentiable.
        """
        rows, columns = (where.any(dim).nonzero()[:, 0] for dim in (1, 0))
        ends = [(int(each[0]), int(each[-1]) + 1) for each in (rows, columns)]
        sizes, first = list(where.shape), 0
        outer = grow_ends(ends, 2 * BLOCKS[0], sizes)
        x = self.prepared(image[box(outer)])
        for count, following in zip(BLOCKS, (*BLOCKS[1:], 0), strict=True):
            for convolve in self.convolutions[first : first + count]:
                x = convolve(x)
            first += count
            # Of what the convolutions saw, what differs and as much around it as they have made wrong.
            inner = grow_ends(ends, count, sizes)
            name, seen = self.names[first - 1], x[box(inner, outer)]
            yield name, box(inner), seen
            if following:
                ends, halves = [(a // 2, (b + 1) // 2) for a, b in inner], [size // 2 for size in sizes]
                outer = grow_ends(ends, 2 * following, halves)
                full = [(2 * a, min(2 * b + 1, size)) for (a, b), size in zip(outer, sizes, strict=True)]
                layer = layers[name][box(full)].clone()
                layer[box(inner, full)] = seen
                x, sizes = F.max_pool2d(layer, 2), halves

    def blocks(self, image: Tensor, wanted: Sequence[str] | None = None) -> dict[int, Tensor]:
        """Return some layers of an image [3, H, W] by stride s, those of a block stacked [C, H/s, W/s]."""
        wanted = self.wanted if wanted is None else wanted
        joined: dict[int, list[Tensor]] = {}
        for name, layer in zip(wanted, self.layers(image[None], wanted), strict=True):
            joined.setdefault(2 ** (int(name[4]) - 1), []).append(layer)
        return {stride: torch.cat(layers, dim=1).squeeze(0) for stride, layers in joined.items()}

    def features(self, image: Tensor) -> Tensor:
        """Return the wanted layers of an image [3, H, W], all of one block, stacked [C, H/s, W/s]."""
        (features,) = self.blocks(image).values()
        return features


def grow_ends(ends: Sequence[tuple[int, int]], margin: int, sizes: Sequence[int]) -> list[tuple[int, int]]:
    """Grow ranges of rows and columns by a margin, within an image of these sizes."""
    return [(max(0, a - margin), min(size, b + margin)) for (a, b), size in zip(ends, sizes, strict=True)]


def box(ends: Sequence[tuple[int, int]], outer: Sequence[tuple[int, int]] = ((0, 0), (0, 0))) -> Box:
    """Return slices of rows and columns relative to the first of others."""
    return (..., *(slice(a - first, b - first) for (a, b), (first, _) in zip(ends, outer, strict=True)))


def rectified_convolution(weight: Tensor, bias: Tensor) -> Callable[[Tensor], Tensor]:
    """Return the function max(0, weight * x + bias) of images x [N, in, H, W] with zeros around them."""
    if weight.device.type == "cpu" and weight.dtype == torch.float32:
        return RectifiedConvolution(weight, bias)
    return by_torch(weight, bias)


def by_torch(weight: Tensor, bias: Tensor) -> Callable[[Tensor], Tensor]:
    """Do as `rectified_convolution`, for any device and dtype."""
    weight = weight.contiguous(memory_format=torch.channels_last)
    return lambda x: F.relu(F.conv2d(x, weight, bias, padding=1), inplace=True)


def channels(name: str) -> int:
    """Return the number of channels of a layer."""
    return CHANNELS[int(name[4]) - 1]


def place(name: str) -> int:
    """Return the index of a convolution in torchvision's list: each has a ReLU, each block a pooling."""
    block, conv = int(name[4]) - 1, int(name[6]) - 1
    return sum(2 * count + 1 for count in BLOCKS[:block]) + 2 * conv
