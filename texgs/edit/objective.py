"""The distance of a view from a style: NNFM and distribution of VGG features, CLIP, patches."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Self

import torch
from torch import Tensor
from torch.nn import functional as F

from texgs.core import check
from texgs.core.errors import ArgumentError
from texgs.core.memory import require_memory
from texgs.edit.recipe import Recipe
from texgs.edit.sliced_wasserstein import FeatureDistribution, PatchStatistics
from texgs.edit.style_picture import StylePicture
from texgs.models.clip import Clip
from texgs.models.nnfm import StyleFeatures, nnfm
from texgs.models.vgg import STYLE_LAYERS, Vgg

FeatureTerm = Callable[[Tensor], Tensor]  # image [H, W, 3] in [0, 1] to a loss []
FINE_LAYERS = ("relu1_2", "relu2_2")  # layers whose distributions are compared besides the style's layers
STRIDE = 4  # pixels between the positions of the features that NNFM compares
OBJECT_ALPHA = 0.5  # least alpha of a feature or a patch that counts
BYTES_PER_STYLE_PIXEL = 1100  # bytes of memory for the features of a pixel
LOSS_SCALE = 4096.0  # factor on losses going backwards: gradients of means would underflow in float16


class ClipLoss:
    """|C(R) - C(S)|, the distance of unit features of whole images; the style's are computed once.

    It is the second term of the paper's loss for image-driven editing. The style is [H, W, 3] in [0, 1].
    """

    def __init__(self, clip: Clip, style: Tensor) -> None:
        check.shape("style", style, "H W 3")
        self.clip = clip
        with torch.no_grad():
            self.target = clip.images(style[None])

    def __call__(self, image: Tensor) -> Tensor:
        """Return the loss [] of an image [H, W, 3] in [0, 1]; differentiable in it."""
        check.shape("image", image, "H W 3")
        return (self.clip.images(image[None]) - self.target).norm()


@dataclass(frozen=True, eq=False)
class Objective:
    """The loss of a recipe for one style, and its terms."""

    recipe: Recipe
    reduce: int
    vgg: Vgg | None
    style: StyleFeatures | None
    distributions: Mapping[int, FeatureDistribution]  # by the stride of their features; empty: not compared
    patches: PatchStatistics | None
    clip: FeatureTerm | None

    @classmethod
    def of(
        cls, recipe: Recipe, style: StylePicture, reduce: int, vgg: Vgg | None, clip: FeatureTerm | None
    ) -> Self:
        """Compute once what the losses need to know about a style, which has the size at which it is to show.

        Features see `reduce` pixels each way as one. NNFM needs a VGG, and a lambda_s below 1 a CLIP term.
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
        distributions: dict[int, FeatureDistribution] = {}
        if recipe.needs_vgg and vgg is not None:
            maps, regions = style_maps(style.scaled(max(style.region.shape) / reduce), recipe, vgg)
            drawn = recipe.positions, recipe.dimensions, recipe.seed
            features = StyleFeatures.of(maps[STRIDE], regions[STRIDE], *drawn)
            for stride, x in maps.items() if recipe.distribution > 0 else ():
                distributions[stride] = FeatureDistribution.of(x, regions[stride], recipe.seed)
        if recipe.patches > 0 and recipe.iterations > 0:
            patches = PatchStatistics.of(style.image, style.region, recipe.seed)
        return cls(recipe, reduce, vgg, features, distributions, patches, clip)

    @classmethod
    def of_views(cls, recipe: Recipe, style: StylePicture, size: tuple[int, int], vgg: Vgg | None) -> Self:
        """Compute the same for a picture behind views of a width and height, without a CLIP term."""
        scaled = style.scaled(recipe.pattern * max(size))
        return cls.of(recipe, scaled, recipe.reduction(*size), vgg, None)

    def terms(self, image: Tensor, share: Tensor, iteration: int) -> dict[str, Tensor]:
        """Return weighted losses [] by name, differentiable in the image [3, h, w] in [0, 1].

        The share [h, w] is how much of each pixel is to look like the style. The iteration chooses the
        directions and the draw of patches.
        """
        recipe, terms = self.recipe, self.feature_terms(image, share, iteration)
        if recipe.needs_clip and self.clip is not None:
            terms["clip"] = recipe.features * (1 - recipe.lambda_s) * self.clip(image.permute(1, 2, 0))
        if self.patches is not None:
            where = (share > OBJECT_ALPHA) if recipe.foreground else None
            terms["patches"] = recipe.patches * self.patches.distance(image, where, iteration, iteration)
        return terms

    def feature_terms(self, image: Tensor, share: Tensor, iteration: int) -> dict[str, Tensor]:
        """Return the terms that compare features of VGG; see `terms`."""
        recipe = self.recipe
        if self.style is None or self.vgg is None:
            return {}
        if min(image.shape[1:]) < STRIDE * self.reduce:  # a sliver has no features
            nothing = 0 * image.sum()
            return {"nnfm": nothing, **({"distribution": nothing} if self.distributions else {})}
        maps = self.vgg.blocks(self.small(image), wanted_layers(recipe))
        on: dict[int, Tensor | None] = dict.fromkeys(maps)
        if recipe.foreground:
            on = {s: object_features(share, self.reduce * s, x.shape[1:]) for s, x in maps.items()}
        weight = recipe.features * recipe.lambda_s
        terms = {"nnfm": weight * nnfm(maps[STRIDE], self.style, on[STRIDE], recipe.queries, iteration)}
        if self.distributions:
            each = self.distributions.items()
            distances = [style.distance(maps[s], on[s], iteration, iteration) for s, style in each]
            terms["distribution"] = weight * recipe.distribution * torch.stack(distances).mean()
        return terms

    def content(self, image: Tensor, target: Tensor) -> Tensor:
        """Return the mean squared distance [] of features of an image and a target, both [3, h, w] (ARF)."""
        assert self.vgg is not None
        features = self.vgg.features(self.small(image))
        with torch.no_grad():
            wanted = self.vgg.features(self.small(target))
        return F.mse_loss(features.float(), wanted.float())

    def small(self, image: Tensor) -> Tensor:
        """Return the image [3, h, w] at the resolution of the features."""
        return F.avg_pool2d(image[None], self.reduce)[0] if self.reduce > 1 else image


def wanted_layers(recipe: Recipe) -> tuple[str, ...]:
    """Return the names of the layers that the losses of a recipe use."""
    return (*FINE_LAYERS, *STYLE_LAYERS) if recipe.distribution > 0 else STYLE_LAYERS


@torch.no_grad()
def style_maps(
    style: StylePicture, recipe: Recipe, vgg: Vgg
) -> tuple[dict[int, Tensor], dict[int, Tensor | None]]:
    """Return features [C, h, w] of a style by stride, and the mask [h, w] of those that count, or None."""
    height, width = style.region.shape
    what = f"features of a style of {width} x {height} pixels"
    require_memory(BYTES_PER_STYLE_PIXEL * height * width, what, "make edit.image.pattern smaller")
    maps = vgg.blocks(style.image, wanted_layers(recipe))
    regions: dict[int, Tensor | None] = {}
    for stride, features in maps.items():
        share = F.interpolate(style.region[None, None].float(), features.shape[1:], mode="area")[0, 0]
        regions[stride] = share > OBJECT_ALPHA if bool((share > OBJECT_ALPHA).any()) else None
    return maps, regions


def object_features(share: Tensor, side: int, size: torch.Size) -> Tensor:
    """Return which features [h / side, w / side] bool are on the object, cropped to the features' size."""
    mean = F.avg_pool2d(share[None], side)[0] > OBJECT_ALPHA
    return mean[: size[0], : size[1]]
