"""The loop of all image-driven edits: a field learns the colours of a style, one view per iteration."""

import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from math import isfinite
from typing import NamedTuple, Protocol

import torch
from torch import Tensor

from texgs.core.errors import FitError
from texgs.core.progress import progress
from texgs.edit.objective import LOSS_SCALE, Objective
from texgs.edit.recipe import Recipe

Terms = Mapping[str, Tensor]  # weighted losses [] by name
Losses = dict[str, list[float]]  # weighted terms by name, a value for each iteration


class Painting(NamedTuple):
    """A rendered view, and the way back to the parameters."""

    image: Tensor  # [3, h, w] in [0, 1], a leaf that losses are differentiated by
    share: Tensor  # [h, w] share of each pixel that should look like the style
    objective: Objective
    backward: Callable[[Tensor], None]  # propagates the gradient of the image to the parameters
    added: Callable[[Tensor], Terms] = lambda image: {}  # further terms besides the objective's


class Paintable(Protocol):
    """A field whose colours learn a style."""

    def render(self, view: int) -> Sequence[Painting]:
        """Render a view: one image, or one for each layer with its own style."""

    def step(self, iteration: int) -> None:
        """Take a step along the gradients of the last view."""


@dataclass(eq=False)
class Stopwatch:
    """Measures seconds by part of the work."""

    device: torch.device
    seconds: dict[str, float] = field(default_factory=lambda: defaultdict(float))

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        """Add the time of the block; on a GPU, wait for its work."""
        begin = time.perf_counter()
        yield
        if self.device.type == "cuda":
            torch.cuda.synchronize(self.device)
        self.seconds[name] += time.perf_counter() - begin


def learn_style(
    paintable: Paintable,
    views: int,
    recipe: Recipe,
    title: str,
    *,
    watch: Stopwatch | None = None,
    show: Callable[[], None] = lambda: None,
) -> Losses:
    """Bring a field closer to its style, one view per iteration.

    The watch measures the parts of iterations; `show` is called after each.
    """
    watch = watch or Stopwatch(torch.device("cpu"))
    losses: Losses = defaultdict(list)
    for iteration, view in enumerate(progress(view_order(views, recipe), title=title, unit="iteration")):
        sums: dict[str, float] = defaultdict(float)
        with watch.part("render"):
            paintings = paintable.render(view)
        for painting in paintings:
            with watch.part("losses"):
                terms: Terms = painting.objective.terms(painting.image, painting.share, iteration)
                terms = {**terms, **painting.added(painting.image)}
                for name, value in finite_values(terms, iteration).items():
                    sums[name] += value
            with watch.part("losses, backward"):
                total = LOSS_SCALE * torch.stack(list(terms.values())).sum()
                gradient = torch.autograd.grad(total, painting.image)[0] / LOSS_SCALE
            with watch.part("render, backward"):
                painting.backward(gradient)
        with watch.part("update"):
            paintable.step(iteration)
        for name, value in sums.items():
            losses[name].append(value)
        show()
    return dict(losses)


def view_order(views: int, recipe: Recipe) -> list[int]:
    """Return the view of each iteration: random permutations of all views."""
    generator = torch.Generator().manual_seed(recipe.seed)
    order: list[int] = []
    while len(order) < recipe.iterations:
        order += torch.randperm(views, generator=generator).tolist()
    return order[: recipe.iterations]


def finite_values(terms: Terms, iteration: int) -> dict[str, float]:
    """Return the values of the terms of a loss; raise an error for values that are not finite."""
    values = {name: float(term.detach()) for name, term in terms.items()}
    if not all(map(isfinite, values.values())):
        raise FitError(
            f"style: the loss is not finite in iteration {iteration + 1} ({values}); lower "
            "the rate, and look for values that are not finite in the model"
        )
    return values


def image_variation(image: Tensor) -> Tensor:
    """Return the mean squared difference [] of neighbouring pixels of [3, h, w], along both sides."""
    down, right = image.diff(dim=1), image.diff(dim=2)
    return (down.square().mean() + right.square().mean()) / 2
