"""Learned perceptual image patch similarity with a VGG backbone."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from texgs.core import check
from texgs.models.tensors import read_tensors
from texgs.models.vgg import Vgg
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
        vgg: str | Path | None = None,
        heads: str | Path | None = None,
        device: torch.device | str = "cpu",
        dtype: torch.dtype = torch.float32,
    ) -> Lpips:
        """Read both files of weights; by default where they are found.

        Raises:
            ArgumentError, MissingDataError: if there is no such file, or it holds something else.
        """
        heads = locate("lpips_vgg") if heads is None else heads
        names = [f"lin{index}.model.1.weight" for index in range(len(LAYERS))]
        stored = read_tensors(heads, names)
        weights = tuple(stored[name].flatten().to(device, torch.float32) for name in names)
        backbone = Vgg.load(vgg, device, LAYERS, dtype)
        for name, weight, layer in zip(names, weights, LAYERS, strict=True):
            check.shape(f"{heads}: {name}", weight, f"{len(backbone.biases[backbone.names.index(layer)])}")
        return cls(backbone, weights)

    def distance(self, image: Tensor, other: Tensor) -> Tensor:
        """How different two images look []: 0 for equal ones; differentiable in both.

        Args:
            image: [H, W, 3] in [0, 1], at least 16 pixels each way; or [N, H, W, 3], for the mean of N.
            other: the same shape.

        Raises:
            ShapeError: if the shapes do not fit.
        """
        if image.ndim == 3:
            image, other = image[None], other[None]
        size = check.shape("image", image, "N H W 3")
        check.shape("other", other, "N H W 3", **size)
        ours, others = (self.vgg.layers(x.permute(0, 3, 1, 2)) for x in (image, other))
        total = image.new_zeros(())
        for a, b, head in zip(ours, others, self.heads, strict=True):
            difference = (unit(a) - unit(b)).square()  # [N, C, h, w]
            total = total + (difference * head[:, None, None]).sum(dim=1).mean()
        return total


def unit(features: Tensor) -> Tensor:
    """Features [N, C, h, w] of length 1 at each position, float32."""
    features = features.float()
    return features / (features.square().sum(dim=1, keepdim=True).sqrt() + EPSILON)
