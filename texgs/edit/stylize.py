"""Image-driven editing: the texels of a basic model take on the style of a picture; nothing else changes."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.light import Light
from texgs.edit.canvas import mean_alpha, paint, require_editable
from texgs.edit.hue import HueBound
from texgs.edit.objective import FeatureTerm, Objective
from texgs.edit.recipe import DEFAULT, Recipe
from texgs.edit.steps import model_at_step, where_shown
from texgs.edit.style_loop import Painting, Stopwatch, learn_style
from texgs.edit.style_picture import StylePicture, mirrored_crop
from texgs.edit.style_start import pixel_side, start_colors
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.texels import owners, spread_colors, with_colors, with_single_texels
from texgs.models.vgg import Vgg


@dataclass(frozen=True, eq=False)
class Stylized:
    """A stylized model, and how it was made."""

    model: Surfels
    recipe: Recipe  # adapted to the scene
    losses: dict[str, list[float]]  # weighted terms by name, a value for each iteration
    seconds: dict[str, float]  # by part of the work


def stylize(
    model: Surfels,
    cameras: Sequence[Camera],
    lights: Sequence[Light],
    style: StylePicture,
    recipe: Recipe = DEFAULT,
    *,
    vgg: Vgg | None = None,
    clip: FeatureTerm | None = None,
    hue: HueBound | None = None,
    surfels: Tensor | None = None,
    steps: Sequence[Surfels] = (),
    title: str = "style",
    show: Callable[[Callable[[], Surfels]], None] = lambda result: None,
) -> Stylized:
    """Give a model the style of a picture (the paper's section Image-Driven NPSE).

    Only texels and the surfels' colours (offsets from the palette) change: palette + offset + texel is the
    stylised colour without light, in [0, 1], so that the palette, lights and opacities can be edited as
    before and highlights stay what they were. Texels that no view shows keep their start colours.

    Args:
        model: of stage texture.
        cameras: to learn from, such as those of the training views; of one size.
        lights: one for each camera.
        style: the picture.
        recipe: how.
        vgg: for NNFM; needed unless the recipe's `features` or `lambda_s` is 0.
        clip: a differentiable loss [] of an image [H, W, 3] in [0, 1], for a `lambda_s` below 1.
        hue: of the model's function, which the style is moved to; by default it keeps its own.
        surfels: [N] bool, surfels to change; by default all. Others keep texels and colours bit for bit.
        steps: the model at other steps of a series, with the same texels: views show all in turn.
        title: of the progress bar.
        show: is called after each iteration with a function that returns the current model.
    """
    require_editable(model, surfels)
    if not cameras or len(lights) != len(cameras):
        raise ArgumentError(
            f"lights: expected one for each of some cameras, got {len(lights)} for {len(cameras)}"
        )
    watch = Stopwatch(model.device)
    with watch.part("start"):
        run = SurfelPainting(model, cameras, lights, style, recipe, vgg, clip, hue, surfels, steps)
    offer = partial(show, run.result)
    losses = learn_style(run, len(cameras), recipe, title, watch=watch, show=offer)
    return Stylized(run.result(), run.recipe, losses, dict(watch.seconds))


def learned_style(style: StylePicture, side: int, recipe: Recipe, hue: HueBound | None) -> StylePicture:
    """Return a style as it is behind views of a longer side, in the colours that are learned from it."""
    vivid = style.scaled(recipe.pattern * side).vivid(recipe.chroma)
    if hue is None:
        return vivid
    return replace(vivid, image=hue.toned(vivid.image.permute(1, 2, 0)).permute(2, 0, 1).contiguous())


class SurfelPainting:
    """Textured surfels that learn a style; see `stylize`."""

    def __init__(
        self,
        model: Surfels,
        cameras: Sequence[Camera],
        lights: Sequence[Light],
        style: StylePicture,
        recipe: Recipe,
        vgg: Vgg | None,
        clip: FeatureTerm | None,
        hue: HueBound | None,
        surfels: Tensor | None,
        steps: Sequence[Surfels] = (),
    ) -> None:
        self.whole = model
        if recipe.adapts:
            recipe = recipe.adapted(mean_alpha(model, cameras, recipe.opacity))
        if not recipe.is_textured:
            model = with_single_texels(model, surfels)
        p = model.parameters
        self.cameras, self.lights, self.recipe, self.surfels, self.hue = cameras, lights, recipe, surfels, hue
        width, height = cameras[0].width, cameras[0].height
        self.style = learned_style(style.to(p["means"].device), max(width, height), recipe, hue)
        self.objective = Objective.of(recipe, self.style, recipe.reduction(width, height), vgg, clip)
        colors = -p["palette"].expand_as(p["colors"])
        places, surfel = owners(p)
        owner = torch.empty_like(surfel).index_copy_(0, places, surfel)  # [T] surfel of each texel
        moving = None if surfels is None else surfels[owner]
        pixel = pixel_side(model, cameras)
        laid = where_shown(model, steps, cameras) if steps else model
        texels = start_colors(recipe.start, laid, self.style, pixel, recipe.seed, moving)
        self.fixed: Tensor | None = None  # [F] indices of fixed texels
        if surfels is not None:
            colors = torch.where(surfels[:, None], colors, p["colors"])
            self.fixed = (~surfels[owner]).nonzero()[:, 0]
            texels[self.fixed] = p["texels"][self.fixed]
        # The colours of surfels are taken out where they change: texels [T, 3] have all of the colour.
        self.model = Surfels({**p, "colors": colors.contiguous()}, model.shading, model.metadata)
        self.steps, self.turn = [self.model, *(model_at_step(self.model, step) for step in steps)], 0
        self.texels = texels.requires_grad_()
        self.generator = torch.Generator().manual_seed(recipe.seed)

    @cached_property
    def adam(self) -> torch.optim.Adam:
        """Return the optimiser. It takes a second to import, for which a preview need not wait."""
        return torch.optim.Adam([self.texels], eps=1e-15, fused=True)

    def render(self, view: int) -> list[Painting]:
        """Render a view over the style or white; in a series, at the next step."""
        model = self.steps[self.turn % len(self.steps)]
        self.turn += 1
        camera, light = self.cameras[view].to(self.model.device), self.lights[view]
        color, alpha, share = paint(model, self.texels, camera, light, self.recipe, self.surfels)
        image = (color.detach() + (1 - alpha) * self.behind(alpha)).clamp(0, 1).requires_grad_()
        own = [] if self.hue is None else [self.hue.loss]
        return [Painting(image, share, self.objective, color.backward, *own)]

    def behind(self, alpha: Tensor) -> Tensor:
        """Return the background [3, h, w]: white, or a random crop of the mirrored style."""
        if self.recipe.behind == "white":
            return alpha.new_ones(3, *alpha.shape)
        top, left = torch.randint(1 << 20, (2,), generator=self.generator).tolist()
        return mirrored_crop(self.style.image, top, left, *alpha.shape)

    @torch.no_grad()
    def step(self, iteration: int) -> None:
        """Take a step of Adam, then clamp colours to [0, 1]."""
        recipe = self.recipe
        self.adam.param_groups[0]["lr"] = recipe.rate * recipe.last_rate ** (iteration / recipe.iterations)
        self.adam.step()
        self.adam.zero_grad(set_to_none=True)
        self.texels.clamp_(0, 1)
        if self.fixed is not None:
            self.texels[self.fixed] = self.model.parameters["texels"][self.fixed]

    def result(self) -> Surfels:
        """Return the model with its current texels."""
        texels = self.texels.detach()
        if self.hue is not None:
            texels = self.hue.at_texels(texels, self.model)
        colors = texels if self.recipe.is_textured else spread_colors(texels, self.model, self.whole)
        return with_colors(self.whole, colors, self.surfels)
