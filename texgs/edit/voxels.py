"""Let voxel grids follow a style (ARF, Zhang et al. 2022) or edited views (Instruct-NeRF2NeRF)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.progress import progress
from texgs.edit.dataset_update import PhotometricLoss
from texgs.edit.objective import Objective
from texgs.edit.recipe import Recipe
from texgs.edit.style_loop import Losses, Painting, Terms, image_variation, learn_style
from texgs.edit.style_picture import StylePicture
from texgs.edit.style_start import color_map
from texgs.fields.voxels import Voxels
from texgs.fitting.rays import training_rays
from texgs.models.vgg import Vgg
from texgs.raster.shading import Y00
from texgs.raster.voxel_grid import GREY, VoxelGrid, drop_sh, recolor
from texgs.raster.voxel_optimizer import VoxelOptimizer, VoxelRates, add_variation_of_some
from texgs.raster.voxels import Rays, Samples, camera_rays
from texgs.volume.images import Images, PixelBox

RAYS, RUN_LENGTH = 5000, 2  # rays per step of ARF's first phase, in runs of neighbours
RATE, LAST_RATE, RATE_STEPS = 0.1, 0.01, 250_000  # ARF's rates for coefficients, log-linear
COUNTED_PIXELS = 1_000_000  # pixels in the statistics of colours
TV_DENSITY, TV_SH = 1e-5, 1e-3  # weights of total variation of densities and of spherical harmonics (IN2N)
OCCUPANCY_INTERVAL = 50  # iterations between updates of occupied cells while densities learn


def stylize_voxels(
    field: Voxels,
    images: Images,
    style: StylePicture,
    recipe: Recipe,
    ray_epochs: float,
    exact: bool,
    weights: Mapping[str, float],
    vgg: Vgg | None = None,
    title: str = "style",
) -> tuple[Voxels, Losses]:
    """Stylize a grid; densities stay, and colours no longer depend on the direction.

    Colours are moved to those of the style, learned from the recoloured views, then from the distance of
    rendered views to the style, and moved once more. For `exact` see `move_colors`.
    """
    generator = torch.Generator().manual_seed(recipe.seed)
    stride = max(1, round((images.planes[:, 0].numel() / COUNTED_PIXELS) ** 0.5))
    planes = images.planes[:, :, ::stride, ::stride].permute(1, 0, 2, 3).flatten(1).float() / 255
    colors = object_colors(planes[:3].T, planes[3], generator, recipe.foreground)
    matrix, offset = (x.float() for x in color_map(colors, style.pixels))
    images = recolored_images(images, matrix, offset, recipe.foreground)
    grid = move_colors(drop_sh(field.grid), matrix, offset, exact)
    objective = Objective.of_views(recipe, style, images.size, vgg)
    run = VoxelPainting(grid, field, images, objective, generator, **weights)
    run.learn_rays(ray_epochs, title)
    losses = learn_style(run, len(images), recipe, title)
    colors = run.rendered_colors(images.cameras, recipe.foreground, stride)
    matrix, offset = (x.float() for x in color_map(colors, style.pixels))
    return replace(field, grid=move_colors(run.grid, matrix, offset, exact)), losses


def object_colors(color: Tensor, alpha: Tensor, generator: torch.Generator, foreground: bool) -> Tensor:
    """Draw colours [M, 3] of the object from pixels [N, 3] over white by their alpha [N]; or take all."""
    if not foreground:
        return color
    drawn = torch.rand(alpha.shape, generator=generator) < alpha
    share = alpha[drawn, None]
    return ((color[drawn] - (1 - share)) / share).clamp(0, 1)


def recolored_images(images: Images, matrix: Tensor, offset: Tensor, foreground: bool) -> Images:
    """Move colours of views, or those of the object alone, by an affine map, and cut them to [0, 1]."""
    planes = images.planes.clone()
    for view in planes:
        alpha = view[3].float() / 255 if foreground else torch.ones(view.shape[1:])
        behind = 1 - alpha  # white
        premultiplied = view[:3].float() / 255 - behind
        color = torch.einsum("ij,jhw->ihw", matrix, premultiplied) + alpha * offset[:, None, None] + behind
        view[:3] = color.clamp(0, 1).mul(255).round().to(torch.uint8)
    return replace(images, planes=planes)


def move_colors(grid: VoxelGrid, matrix: Tensor, offset: Tensor, is_exact: bool) -> VoxelGrid:
    """Return the grid with mapped colours; not exact: coefficients s become A s + b, as in ARF's code."""
    if not is_exact:
        offset = Y00 * offset + GREY - GREY * matrix.sum(1)
    return recolor(grid, matrix, offset)


def sample_rays(grid: VoxelGrid, field: Voxels, rays: Tensor) -> tuple[Samples, Rays]:
    """Sample rays [N, 6] over white; return the samples and the blended result."""
    out = Rays(rays.new_empty(len(rays), 3), *rays.new_empty(2, len(rays)))
    return Samples(grid, field.march, rays, out), out


class VoxelPainting:
    """A grid of degree 0 that learns a style; rays and blocks are drawn at random."""

    def __init__(
        self,
        grid: VoxelGrid,
        field: Voxels,
        images: Images,
        objective: Objective,
        generator: torch.Generator,
        content: float,
        variation: float,
        sh_variation: float,
    ) -> None:
        self.grid, self.original, self.images, self.objective = grid, field, images, objective
        self.content, self.variation, self.sh_variation = content, variation, sh_variation
        self.generator, self.optimizer = generator, VoxelOptimizer(grid)

    def learn_rays(self, epochs: float, title: str) -> None:
        """Learn the colours of rays through the pixels of views."""
        rays = training_rays(self.images)
        steps = range(round(epochs * len(rays) / RAYS))
        for step in progress(steps, title=f"{title}, recoloured views", unit="step"):
            drawn, target = rays.draw(RAYS, RUN_LENGTH, self.generator)
            samples, out = sample_rays(self.grid, self.original, drawn)
            error = out.color - target
            samples.add_gradient(error * (2 / error.numel()), None, self.optimizer.gradient)
            self.step(step)

    def render(self, view: int) -> list[Painting]:
        """Render a view over white."""
        width, height = self.images.size
        target = self.images.target(view)
        samples, out = sample_rays(self.grid, self.original, camera_rays(target.camera).flatten(0, 1))
        image = out.color.unflatten(0, (height, width)).permute(2, 0, 1).contiguous().requires_grad_()

        def backward(gradient: Tensor) -> None:
            flat = gradient.permute(1, 2, 0).flatten(0, 1)
            samples.add_gradient(flat, None, self.optimizer.gradient)

        def added(image: Tensor) -> Terms:
            terms = {}
            if self.content and self.objective.recipe.needs_vgg:
                content = self.objective.content(image, target.color.permute(2, 0, 1))
                terms["content"] = self.content * content
            terms["variation"] = self.variation * image_variation(image)
            return terms

        return [Painting(image, out.alpha.reshape(height, width), self.objective, backward, added)]

    def rendered_colors(self, cameras: Sequence[Camera], foreground: bool, stride: int) -> Tensor:
        """Return the colours [M, 3] of rendered views."""
        colors = []
        for camera in cameras:
            rays = camera_rays(camera)[::stride, ::stride].flatten(0, 1).contiguous()
            _, out = sample_rays(self.grid, self.original, rays)
            colors.append(object_colors(out.color, out.alpha, self.generator, foreground))
        return torch.cat(colors)

    def step(self, step: int) -> None:
        """Take a step of RMSProp on the colours, with total variation of some random blocks."""
        variation = (0.0, self.sh_variation, self.generator, self.optimizer.gradient)
        add_variation_of_some(self.grid, *variation)
        rate = RATE * (LAST_RATE / RATE) ** (step / RATE_STEPS)
        self.optimizer.step(VoxelRates(0.0, rate, rate))


class VoxelLearner:
    """A grid that learns from patches of views by RMSProp; the given field stays unchanged."""

    def __init__(
        self, field: Voxels, loss: PhotometricLoss, rates: VoxelRates, patches: int, side: int
    ) -> None:
        self.original, self.loss, self.rates, self.patches, self.side = field, loss, rates, patches, side
        self.grid = field.grid.with_rows(field.grid.rows.clone())
        self.optimizer = VoxelOptimizer(self.grid)
        self.iteration = 0

    @property
    def field(self) -> Voxels:
        """Return the current grid."""
        self.grid.refresh_occupancy()
        return replace(self.original, grid=self.grid)

    @torch.no_grad()
    def step(self, images: Images, views: Sequence[int], generator: torch.Generator) -> float:
        """Learn from patches of these views, drawn at random around what is visible; return the loss."""
        side, size = min(self.side, *images.size), images.size
        rays, wanted = [], []
        for place in torch.randint(len(views), (self.patches,), generator=generator).tolist():
            left, top = corner(images.boxes[views[place]], side, size, generator)
            camera = images.cameras[views[place]].crop(left, top, left + side, top + side)
            rays.append(camera_rays(camera).flatten(0, 1))
            wanted.append(images.planes[views[place], :3, top : top + side, left : left + side])
        samples, out = sample_rays(self.grid, self.original, torch.cat(rays))
        target = torch.stack(wanted).permute(0, 2, 3, 1).float() / 255
        with torch.enable_grad():
            loss, gradient = self.loss.with_gradient(out.color.reshape(target.shape), target)
        samples.add_gradient(gradient.reshape(-1, 3), None, self.optimizer.gradient)
        weight = TV_DENSITY if self.rates.density else 0.0
        add_variation_of_some(self.grid, weight, TV_SH, generator, self.optimizer.gradient)
        self.optimizer.step(self.rates)
        self.iteration += 1
        if self.rates.density and self.iteration % OCCUPANCY_INTERVAL == 0:
            self.grid.refresh_occupancy()
        return loss


def corner(box: PixelBox, side: int, size: tuple[int, int], generator: torch.Generator) -> tuple[int, int]:
    """Draw left and top of a patch inside of an image of this width and height, its middle from a box."""
    low, high = torch.tensor(box[:2]), torch.tensor(box[2:])
    middle = low + (torch.rand(2, generator=generator) * (high - low)).long()
    left, top = (middle - side // 2).clamp_min(0).minimum(torch.tensor(size) - side).tolist()
    return left, top
