"""How far a view is from a style: NNFM of VGG features, a CLIP term, sliced distance of patches."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import isfinite

import torch
from torch import Tensor
from torch.nn import functional as F

from texgs.core.errors import ArgumentError, FitError
from texgs.edit.recipe import Recipe
from texgs.edit.sliced import PatchStatistics, sliced_wasserstein
from texgs.edit.style_picture import StylePicture
from texgs.models.nnfm import StyleFeatures, nnfm
from texgs.models.vgg import Vgg

FeatureTerm = Callable[[Tensor], Tensor]  # image [H, W, 3] in [0, 1] to a loss []
STRIDE = 4  # pixels between the positions of VGG's features
ON_OBJECT = 0.5  # of alpha, from which a feature or a patch counts
LOSS_SCALE = 4096.0  # while it goes backwards: gradients of a mean over features would underflow in float16


@dataclass(frozen=True, eq=False)
class Objective:
    """The loss of a recipe for one style, and its terms."""

    recipe: Recipe
    reduce: int
    vgg: Vgg | None
    style: StyleFeatures | None
    patches: PatchStatistics | None
    clip: FeatureTerm | None

    @classmethod
    def of(
        cls, recipe: Recipe, style: StylePicture, reduce: int, vgg: Vgg | None, clip: FeatureTerm | None
    ) -> Objective:
        """Compute once what the losses need to know about a style.

        Args:
            recipe: weights of the losses.
            style: at the size at which it is to show.
            reduce: pixels each way that features see as one.
            vgg: needed by NNFM.
            clip: a differentiable loss of an image [H, W, 3], needed where lambda_s is below 1.

        Raises:
            ArgumentError: if a model is needed and not given.
        """
        if recipe.needs_vgg and vgg is None:
            raise ArgumentError(
                "vgg: expected a VGG for this recipe, got none; load it, or choose recipe patches"
            )
        if recipe.needs_clip and clip is None:
            raise ArgumentError(
                f"clip: expected a CLIP term for lambda_s = {recipe.lambda_s:g}, got none; set it to 1"
            )
        features = patches = None
        if recipe.needs_vgg and vgg is not None:
            small = style.scaled(max(style.region.shape) / reduce)
            with torch.no_grad():
                maps = vgg.features(small.image)
            region = (
                F.interpolate(small.region[None, None].float(), maps.shape[1:], mode="area")[0, 0] > ON_OBJECT
            )
            features = StyleFeatures.of(
                maps,
                region if bool(region.any()) else None,
                recipe.positions,
                recipe.dimensions,
                recipe.seed,
            )
        if recipe.patches > 0 and recipe.iterations > 0:
            patches = PatchStatistics.of(style.image, style.region, recipe.seed)
        return cls(recipe, reduce, vgg, features, patches, clip)

    def terms(self, image: Tensor, share: Tensor, iteration: int) -> dict[str, Tensor]:
        """Weighted losses [] by name, differentiable in the image.

        Args:
            image: [3, h, w] in [0, 1].
            share: [h, w] how much of each pixel is to look like the style.
            iteration: chooses the directions and the draw of patches.
        """
        recipe, terms = self.recipe, {}
        if self.style is not None and self.vgg is not None:
            features = self.vgg.features(self.small(image))
            where = pooled(share, self.reduce * STRIDE, features.shape[1:]) if recipe.foreground else None
            distance = nnfm(features, self.style, where, recipe.queries, iteration)
            terms["nnfm"] = recipe.features * recipe.lambda_s * distance
        if recipe.needs_clip and self.clip is not None:
            terms["clip"] = recipe.features * (1 - recipe.lambda_s) * self.clip(image.permute(1, 2, 0))
        if self.patches is not None:
            where = (share > ON_OBJECT) if recipe.foreground else None
            terms["patches"] = recipe.patches * sliced_wasserstein(
                image, self.patches, where, iteration, iteration
            )
        return terms

    def content(self, image: Tensor, target: Tensor) -> Tensor:
        """Mean squared distance [] of the features of an image and a target, both [3, h, w], as ARF has it.

        Raises:
            ArgumentError: if the recipe has no features.
        """
        if self.vgg is None:
            raise ArgumentError("vgg: expected a VGG for the distance of contents, got none; load it")
        features = self.vgg.features(self.small(image))
        with torch.no_grad():
            wanted = self.vgg.features(self.small(target))
        return F.mse_loss(features.float(), wanted.float())

    def small(self, image: Tensor) -> Tensor:
        """The image [3, h, w] as features see it."""
        return F.avg_pool2d(image[None], self.reduce)[0] if self.reduce > 1 else image


def view_order(views: int, recipe: Recipe) -> list[int]:
    """Which view each iteration looks at: all of them in random order once before any again."""
    generator = torch.Generator().manual_seed(recipe.seed)
    order: list[int] = []
    while len(order) < recipe.iterations:
        order += torch.randperm(views, generator=generator).tolist()
    return order[: recipe.iterations]


def finite_values(terms: Mapping[str, Tensor], iteration: int) -> dict[str, float]:
    """Values of the terms of a loss.

    Raises:
        FitError: if one is not finite.
    """
    values = {name: float(term.detach()) for name, term in terms.items()}
    if not all(map(isfinite, values.values())):
        raise FitError(
            f"style: the loss is not finite in iteration {iteration + 1} ({values}); lower "
            "the rate, and look for values that are not finite in the model"
        )
    return values


def differentiated(terms: Mapping[str, Tensor], image: Tensor) -> Tensor:
    """Gradient of the sum of some terms, of the shape of the image that they are of."""
    total = LOSS_SCALE * torch.stack(list(terms.values())).sum()
    return torch.autograd.grad(total, image)[0] / LOSS_SCALE


def pooled(share: Tensor, side: int, size: torch.Size) -> Tensor:
    """Whether each of [h / side, w / side] features is on the object, bool, cut to the features' size."""
    mean = F.avg_pool2d(share[None], side)[0] > ON_OBJECT
    return mean[: size[0], : size[1]]
