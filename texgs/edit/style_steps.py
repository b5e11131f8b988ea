"""An image-driven edit on its way: texels that learn from one view after the other."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.light import Light
from texgs.edit.canvas import paint, visible_part
from texgs.edit.objective import FeatureTerm, Objective, differentiated, finite_values
from texgs.edit.recipe import Recipe
from texgs.edit.style_picture import StylePicture, mirrored_crop
from texgs.edit.style_start import pixel_side, start_colors
from texgs.edit.translucency import mean_alpha
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.texels import mean_texels, owners, recolored
from texgs.models.vgg import Vgg


@dataclass(eq=False)
class Stopwatch:
    """Seconds by part."""

    device: torch.device
    seconds: dict[str, float] = field(default_factory=lambda: defaultdict(float))

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        """Add the time that the block takes, on a GPU until its work is done there."""
        begin = time.perf_counter()
        yield
        if self.device.type == "cuda":
            torch.cuda.synchronize(self.device)
        self.seconds[name] += time.perf_counter() - begin


@dataclass(eq=False)
class StyleSteps:
    """What an edit knows from one step to the next."""

    model: Surfels  # with the colours of its surfels taken out where they change
    recipe: Recipe
    style: StylePicture  # at the size at which it is behind the object
    objective: Objective
    texels: Tensor  # [T, 3] that learn
    adam: torch.optim.Optimizer
    generator: torch.Generator
    surfels: Tensor | None  # [N] bool, those that change
    fixed: Tensor | None  # [F] indices of texels that stay
    owner: Tensor  # [T] surfel of each texel

    @classmethod
    def prepare(
        cls,
        model: Surfels,
        cameras: Sequence[Camera],
        style: StylePicture,
        recipe: Recipe,
        vgg: Vgg | None,
        clip: FeatureTerm | None,
        surfels: Tensor | None,
    ) -> StyleSteps:
        """Lay the style onto the surface and compute its features."""
        p = model.parameters
        if recipe.adapts:
            recipe = recipe.adapted(mean_alpha(model, cameras))
        width, height = cameras[0].width, cameras[0].height
        scaled = style.to(p["means"].device).scaled(recipe.pattern * max(width, height)).vivid(recipe.chroma)
        objective = Objective.of(recipe, scaled, recipe.reduction(width, height), vgg, clip)
        colors, fixed = -p["palette"].expand_as(p["colors"]), None
        places, surfel = owners(p)
        owner = torch.empty_like(surfel).index_copy_(0, places, surfel)
        moving = None if surfels is None else surfels[owner]
        texels = start_colors(recipe.start, model, scaled, pixel_side(model, cameras), recipe.seed, moving)
        if not recipe.is_textured:
            texels = mean_texels({**p, "texels": texels}).to(texels)[owner]
        if surfels is not None:
            colors = torch.where(surfels[:, None], colors, p["colors"])
            fixed = (~surfels[owner]).nonzero()[:, 0]
            texels[fixed] = p["texels"][fixed]
        bare = Surfels({**p, "colors": colors.contiguous()}, model.shading, model.metadata)
        texels.requires_grad_()
        adam = torch.optim.Adam([texels], eps=1e-15, fused=True)
        generator = torch.Generator().manual_seed(recipe.seed)
        return cls(bare, recipe, scaled, objective, texels, adam, generator, surfels, fixed, owner)

    def step(self, camera: Camera, light: Light, iteration: int, watch: Stopwatch) -> dict[str, float]:
        """Learn from one view; the terms of its loss."""
        with watch.part("render"):
            canvas = paint(
                self.model,
                self.texels,
                camera,
                light,
                opacity=self.recipe.opacity,
                is_lit=self.recipe.is_lit,
                cropped=self.recipe.cropped,
                chosen=self.surfels,
            )
            whole = slice(None), slice(None)
            part = visible_part(canvas.alpha) if self.recipe.cropped else whole
            color = canvas.color[:, *part]
            alpha = canvas.alpha[part]
            image = (color.detach() + (1 - alpha) * self.behind(alpha)).clamp(0, 1).requires_grad_()
        with watch.part("losses"):
            share = alpha if canvas.share is None else canvas.share[part]
            terms = self.objective.terms(image, share, iteration)
            values = finite_values(terms, iteration)
        with watch.part("losses, backward"):
            gradient = differentiated(terms, image)
        with watch.part("render, backward"):
            color.backward(gradient)
        with watch.part("update"):
            self.update(iteration)
        return values

    def behind(self, alpha: Tensor) -> Tensor:
        """What is behind the object [3, h, w]: white, or somewhere in the mirrored style."""
        if self.recipe.behind == "white":
            return alpha.new_ones(3, *alpha.shape)
        top, left = torch.randint(1 << 20, (2,), generator=self.generator).tolist()
        return mirrored_crop(self.style.image, top, left, *alpha.shape)

    @torch.no_grad()
    def update(self, iteration: int) -> None:
        """A step of Adam, after which colours are in [0, 1] again."""
        recipe = self.recipe
        self.adam.param_groups[0]["lr"] = recipe.rate * recipe.last_rate ** (iteration / recipe.iterations)
        if not recipe.is_textured:  # equal gradients keep equal what starts equal
            p = {**self.model.parameters, "texels": self.texels.grad}
            self.texels.grad = mean_texels(p).to(self.texels)[self.owner]  # type: ignore[arg-type]
        self.adam.step()
        self.adam.zero_grad(set_to_none=True)
        self.texels.clamp_(0, 1)
        if self.fixed is not None:
            self.texels[self.fixed] = self.model.parameters["texels"][self.fixed]

    def result(self) -> Surfels:
        """The model with the texels as they are now."""
        return recolored(self.model, self.texels.detach(), self.surfels)
