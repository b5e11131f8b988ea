"""ARF: the colours of a voxel grid follow a style; where it is stays (Zhang et al. 2022)."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.progress import progress
from texgs.edit.color_transfer import color_map
from texgs.edit.objective import Objective, differentiated, finite_values, view_order
from texgs.edit.recipe import Recipe
from texgs.edit.style_picture import StylePicture
from texgs.fields.voxels.model import Voxels
from texgs.fields.voxels.rays import training_rays
from texgs.models.vgg import Vgg
from texgs.raster.spherical_harmonics import Y00
from texgs.raster.voxel_colors import GREY, drop_sh, recolored
from texgs.raster.voxel_grid import VoxelGrid
from texgs.raster.voxel_optimizer import VoxelOptimizer, VoxelRates, add_variation_of_some
from texgs.raster.voxels import Rays, Samples, camera_rays
from texgs.volume.images import Images

RAYS, RUN = 5000, 2  # a step of the first phase, and neighbours among them
RATE, LAST_RATE, RATE_STEPS = 0.1, 0.01, 250_000  # of coefficients, log-linear
COUNTED = 1_000_000  # pixels that statistics of colours look at


@dataclass(frozen=True)
class ArfWeights:
    """What ARF adds to the distance to the style."""

    content: float = 5e-3  # squared distance of features to those of the recoloured views
    variation: float = 1.0  # of the image
    sh_variation: float = 5e-3  # of the coefficients
    epochs: float = 1.0  # that rays of the recoloured views are learned for at first
    is_exact: bool = True  # whether colours are mapped, or coefficients as if they were colours (ARF's code)


def stylize_voxels(
    field: Voxels,
    images: Images,
    style: StylePicture,
    recipe: Recipe,
    weights: ArfWeights,
    vgg: Vgg | None = None,
    title: str = "style",
) -> tuple[Voxels, dict[str, list[float]]]:
    """Give a grid the style of a picture; densities stay, and colours no longer depend on the direction.

    Colours are moved to those of the style, learned from the recoloured views, then from the distance of
    rendered views to the style, and moved once more.

    Args:
        field: fitted.
        images: its training views.
        style: the picture.
        recipe: of the distance to the style; a view in each iteration.
        weights: of what is added to it.
        vgg: for NNFM, if the recipe wants it.
        title: of progress bars.

    Returns:
        The grid, and the weighted terms of the loss by name, a value for each iteration.
    """
    generator = torch.Generator().manual_seed(recipe.seed)
    stride = max(1, round((images.planes[:, 0].numel() / COUNTED) ** 0.5))
    planes = images.planes[:, :, ::stride, ::stride].permute(1, 0, 2, 3).flatten(1).float() / 255
    colors = object_colors(planes[:3].T, planes[3], generator, recipe.foreground)
    matrix, offset = (x.float() for x in color_map(colors, style.pixels))
    images = recolored_images(images, matrix, offset, recipe.foreground)
    run = ArfSteps(moved(drop_sh(field.grid), matrix, offset, weights.is_exact), field, weights, generator)
    run.learn_rays(images, title)
    losses = run.learn_style(images, style, recipe, vgg, title)
    colors = run.rendered_colors(images.cameras, recipe.foreground, stride)
    matrix, offset = (x.float() for x in color_map(colors, style.pixels))
    return replace(field, grid=moved(run.grid, matrix, offset, weights.is_exact)), losses


def object_colors(color: Tensor, alpha: Tensor, generator: torch.Generator, foreground: bool) -> Tensor:
    """Colours [M, 3] of the object, drawn from pixels [N, 3] over white by their alpha [N]; or all pixels."""
    if not foreground:
        return color
    drawn = torch.rand(alpha.shape, generator=generator) < alpha
    share = alpha[drawn, None]
    return ((color[drawn] - (1 - share)) / share).clamp(0, 1)


def recolored_images(images: Images, matrix: Tensor, offset: Tensor, foreground: bool) -> Images:
    """Views whose colours, or those of the object alone, are moved by an affine map, and cut to [0, 1]."""
    planes = images.planes.clone()
    for view in planes:
        alpha = view[3].float() / 255 if foreground else torch.ones(view.shape[1:])
        behind = 1 - alpha  # white
        premultiplied = view[:3].float() / 255 - behind
        color = torch.einsum("ij,jhw->ihw", matrix, premultiplied) + alpha * offset[:, None, None] + behind
        view[:3] = color.clamp(0, 1).mul(255).round().to(torch.uint8)
    return replace(images, planes=planes)


def moved(grid: VoxelGrid, matrix: Tensor, offset: Tensor, is_exact: bool) -> VoxelGrid:
    """The grid with mapped colours; not exact: coefficients s become A s + b, as in ARF's code."""
    if not is_exact:
        offset = Y00 * offset + GREY - GREY * matrix.sum(1)
    return recolored(grid, matrix, offset)


class ArfSteps:
    """A grid on its way to a style.

    Args:
        grid: that learns, of degree 0.
        field: it is from.
        weights: of what is added to the distance to the style.
        generator: of rays and blocks.
    """

    def __init__(
        self, grid: VoxelGrid, field: Voxels, weights: ArfWeights, generator: torch.Generator
    ) -> None:
        self.grid, self.march, self.weights, self.generator = grid, field.march, weights, generator
        self.optimizer = VoxelOptimizer(grid)

    def learn_rays(self, images: Images, title: str) -> None:
        """Follow the colours of rays through the pixels of views."""
        rays = training_rays(images)
        steps = range(round(self.weights.epochs * len(rays) / RAYS))
        for step in progress(steps, title=f"{title}, recoloured views", unit="step"):
            drawn, target = rays.draw(RAYS, RUN, self.generator)
            samples, out = self.render(drawn)
            error = out.color - target
            samples.add_gradient(error * (2 / error.numel()), None, self.optimizer.gradient)
            self.update(step)

    def learn_style(
        self, images: Images, style: StylePicture, recipe: Recipe, vgg: Vgg | None, title: str
    ) -> dict[str, list[float]]:
        """Follow the distance of whole views to the style; its terms by name."""
        width, height = images.size
        scaled = style.scaled(recipe.pattern * max(width, height))
        objective = Objective.of(recipe, scaled, recipe.reduction(width, height), vgg, None)
        losses: dict[str, list[float]] = defaultdict(list)
        order = view_order(len(images), recipe)
        for iteration, index in enumerate(progress(order, title=title, unit="iteration")):
            target = images.target(index)
            samples, out = self.render(camera_rays(target.camera).flatten(0, 1))
            image = out.color.unflatten(0, (height, width)).permute(2, 0, 1).contiguous().requires_grad_()
            terms = objective.terms(image, out.alpha.reshape(height, width), iteration)
            if self.weights.content and recipe.needs_vgg:
                content = objective.content(image, target.color.permute(2, 0, 1))
                terms["content"] = self.weights.content * content
            terms["variation"] = self.weights.variation * image_variation(image)
            for name, value in finite_values(terms, iteration).items():
                losses[name].append(value)
            gradient = differentiated(terms, image).permute(1, 2, 0).flatten(0, 1)
            samples.add_gradient(gradient, None, self.optimizer.gradient)
            self.update(iteration)
        return dict(losses)

    def rendered_colors(self, cameras: Sequence[Camera], foreground: bool, stride: int) -> Tensor:
        """Colours [M, 3] that views of the grid have."""
        colors = []
        for camera in cameras:
            rays = camera_rays(camera)[::stride, ::stride].flatten(0, 1).contiguous()
            _, out = self.render(rays)
            colors.append(object_colors(out.color, out.alpha, self.generator, foreground))
        return torch.cat(colors)

    def render(self, rays: Tensor) -> tuple[Samples, Rays]:
        """Samples of rays over white, and what they bring back."""
        out = Rays(rays.new_empty(len(rays), 3), *rays.new_empty(2, len(rays)))
        return Samples(self.grid, self.march, rays, out), out

    def update(self, step: int) -> None:
        """A step of RMSProp on the colours, with total variation of some random blocks."""
        variation = (0.0, self.weights.sh_variation, self.generator, self.optimizer.gradient)
        add_variation_of_some(self.grid, *variation)
        rate = RATE * (LAST_RATE / RATE) ** (step / RATE_STEPS)
        self.optimizer.step(VoxelRates(0.0, rate, rate))


def image_variation(image: Tensor) -> Tensor:
    """Mean squared difference [] of neighbouring pixels of [3, h, w], along both sides."""
    down, right = image.diff(dim=1), image.diff(dim=2)
    return (down.square().mean() + right.square().mean()) / 2
