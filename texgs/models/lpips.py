"""Learned perceptual image patch similarity with a VGG backbone."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import torch
from torch import Tensor

from texgs.core import check
from texgs.models.networks import read_tensors
from texgs.models.vgg import Vgg, channels
from texgs.models.weights import locate

LAYERS = ("relu1_2", "relu2_2", "relu3_3", "relu4_3", "relu5_3")
EPSILON = 1e-10


@dataclass(frozen=True, eq=False)
class Lpips:
    """LPIPS v0.1 (Zhang et al. 2018): features of VGG-16, compared by learned weights of their channels."""

    vgg: Vgg
    heads: tuple[Tensor, ...]  # [C] for each layer, 0 or more

    @classmethod
    def load(
        cls,
        vgg: Vgg | str | Path | None = None,
        heads: str | Path | None = None,
        device: torch.device | str = "cpu",
        dtype: torch.dtype | None = torch.float32,
    ) -> Self:
        """Read both files of weights, by default from their known places; a VGG with `LAYERS` may be given.

        By default features use the fastest dtype, see `Vgg.load`.
        """
        heads = locate("lpips_vgg") if heads is None else heads
        names = [f"lin{index}.model.1.weight" for index in range(len(LAYERS))]
        stored = read_tensors(heads, names)
        weights = tuple(stored[name].flatten().to(device, torch.float32) for name in names)
        backbone = vgg if isinstance(vgg, Vgg) else Vgg.load(vgg, device, LAYERS, dtype)
        for name, weight, layer in zip(names, weights, LAYERS, strict=True):
            check.shape(f"{heads}: {name}", weight, f"{channels(layer)}")
        return cls(backbone, weights)

    def features(self, images: Tensor) -> list[Tensor]:
        """Return the features that LPIPS compares of images [H, W, 3] or [N, H, W, 3]; differentiable.

        They have 16 pixels at least each way. Features are [N, C, H/s, W/s] of length 1, s = 1, 2, 4 ...
        """
        if images.ndim == 3:
            images = images[None]
        check.shape("image", images, "N H W 3")
        return [unit(layer) for layer in self.vgg.layers(images.permute(0, 3, 1, 2), LAYERS)]

    def between(self, ours: Sequence[Tensor], others: Sequence[Tensor]) -> Tensor:
        """Return the LPIPS distance [] of images, given their features; differentiable in both."""
        total = ours[0].new_zeros(())
        for a, b, head in zip(ours, others, self.heads, strict=True):
            difference = (a - b).square()  # [N, C, h, w]
            total = total + (difference * head[:, None, None]).sum(dim=1).mean()
        return total

    def distance(self, image: Tensor, other: Tensor) -> Tensor:
        """Return the LPIPS distance [] of two images, or the mean of N pairs."""
        if image.ndim == 3:
            image, other = image[None], other[None]
        size = check.shape("image", image, "N H W 3")
        check.shape("other", other, "N H W 3", **size)
        return self.between(self.features(image), self.features(other))

    def changed(self, layers: Mapping[str, Tensor], image: Tensor, where: Tensor) -> float:
        """Return the distance of an image [H, W, 3] from one that differs in some pixels [H, W] at most.

        Of that one the outputs [1, C, h, w] of `LAYERS` are given; VGG runs around these pixels only.
        """
        total = 0.0
        parts = self.vgg.changed(layers, image.permute(2, 0, 1)[None], where)
        for (name, part, seen), head in zip(parts, self.heads, strict=True):
            before, now = (x[0].permute(1, 2, 0).float() for x in (layers[name][part], seen))  # [h, w, C]
            lengths = [torch.linalg.vector_norm(x, dim=2, keepdim=True) + EPSILON for x in (before, now)]
            difference = (before / lengths[0]).addcdiv_(now, lengths[1], value=-1)
            total += float((difference.square_() @ head).sum()) / layers[name][0, 0].numel()
        return total


def unit(features: Tensor) -> Tensor:
    """Return features [N, C, h, w] of length 1 at each position, float32."""
    features = features.float()
    return features / (features.square().sum(dim=1, keepdim=True).sqrt() + EPSILON)
