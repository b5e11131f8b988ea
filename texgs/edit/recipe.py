"""The numbers of an image-driven edit, named presets of them, and schedules of edits of views."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, Self

Start = Literal["projected", "sphere", "mean", "random", "transfer"]
OPAQUE_ALPHA = 0.8  # mean alpha above which a scene counts as opaque
FULL_RESOLUTION = 500  # pixels of the longer side up to which features use full resolution


@dataclass(frozen=True)
class Recipe:
    """Numbers of an image-driven edit, by default those of the preset `default`.

    The loss is features * (lambda_s * (NNFM + distribution * D) + (1 - lambda_s) * CLIP) + patches * P, with
    the sliced Wasserstein distances D of features and P of patches of pixels.
    """

    iterations: int = 100  # one view each
    start: Start = "projected"  # colours at the start: the picture laid onto the surface, or by its normals
    # where it shows a sphere, its mean, random pixels, or the model's own colours moved to its colours
    rate: float = 0.05  # Adam's rate at the start
    last_rate: float = 0.1  # Adam's rate at the end, relative to the start
    features: float = 1.0  # weight of NNFM and CLIP together; at 0 no weights of VGG are needed
    lambda_s: float = 1.0  # share of NNFM in them; below 1 a CLIP term is needed
    distribution: float = 0.25  # weight of the sliced Wasserstein distance of features
    patches: float = 50.0  # weight of the distance of patches of pixels
    pattern: float = 1.0  # size of the style's pattern: its longer side, in longer sides of a view
    behind: Literal["style", "white"] = "style"  # background: more of the style, or white
    cropped: bool = True  # whether losses see a crop around the object
    foreground: bool = True  # whether only features on the object have to match
    queries: int | None = 2048  # features of a view to match, drawn at random; None: all
    positions: int | None = 8192  # features of the style to search, drawn at random; None: all
    dimensions: int | None = 64  # principal components in that search; None: all, which is exact
    reduce: int | None = None  # pixels each way to average for features; None: automatic
    opacity: float = 1.0  # factor on opacities while stylising, which gives the front more weight
    chroma: float = 1.0  # factor on the differences of the style's colours from grey
    adapts: bool = True  # whether opacity, chroma and weights follow how translucent the scene is
    is_textured: bool = True  # whether each texel learns, or each surfel one colour: the paper's ablation
    is_lit: bool = True  # whether the losses see the light of the views, or colours without any
    single_precision: bool = False  # whether features use float32, or the machine's fastest type
    seed: int = 0

    @property
    def needs_vgg(self) -> bool:
        """Return whether VGG is used at all."""
        return self.iterations > 0 and self.features > 0 and self.lambda_s > 0

    @property
    def needs_clip(self) -> bool:
        """Return whether a CLIP term is used."""
        return self.iterations > 0 and self.features > 0 and self.lambda_s < 1

    def reduction(self, width: int, height: int) -> int:
        """Return the number of pixels each way to average for features, for views of this size."""
        return self.reduce or max(1, round(max(width, height) / FULL_RESOLUTION))

    def adapted(self, alpha: float) -> Self:
        """Adapt the recipe to a scene with this mean alpha, see `canvas.mean_alpha`.

        Layers are averaged in a pixel of a translucent scene. Each learns as if it were opaque. A pixel shows
        the share alpha of the differences between its colours, so these are divided by it beforehand.
        Distributions of features weigh more, as they tell what is left of a pattern; those of pixels, which
        an average cannot have, do not count beside them.
        """
        if not self.adapts or alpha >= OPAQUE_ALPHA:
            return self
        return replace(
            self,
            opacity=8 * self.opacity,
            chroma=self.chroma / alpha,
            distribution=8 * self.distribution,
            patches=0.0 if self.features > 0 else self.patches,
        )


DEFAULT = Recipe(pattern=0.7)
PRESETS = {
    "default": DEFAULT,
    "patches": replace(DEFAULT, features=0.0, iterations=150, rate=0.025),
    "preview": replace(DEFAULT, iterations=0),
    "paper": Recipe(
        iterations=3000,
        start="random",
        rate=0.025,
        last_rate=1.0,
        lambda_s=0.9,
        distribution=0.0,
        patches=0.0,
        behind="white",
        cropped=False,
        foreground=False,
        queries=None,
        positions=None,
        dimensions=None,
        reduce=1,
        adapts=False,
        single_precision=True,
    ),
}


def preset(name: str, **changes: Any) -> Recipe:
    """Return a recipe of `PRESETS` by name, with some of its numbers changed."""
    return replace(PRESETS[name], **changes)


@dataclass(frozen=True)
class UpdateSchedule:
    """Rounds of edits, and the iterations after each.

    A round edits some views, `group` of them together before each of its first iterations, until all of
    them are edited.
    """

    rounds: int
    period: int  # iterations of a round
    views: int | None = None  # views to edit in a round; None: all
    group: int = 1  # views to edit together
    order: Literal["next", "random"] = "next"  # continue after the last round, or draw at random
    learned: Literal["all", "newest", "round"] = "all"  # views: all, newest, this round's
    levels: Sequence[tuple[float, float]] = ((1.0, 1.0),)  # from and to, by round; the last one repeats

    @property
    def iterations(self) -> int:
        """Return the number of iterations in all rounds."""
        return self.rounds * self.period
