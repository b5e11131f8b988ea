"""What keeps a new look readable: opacity shows its pattern, hue lets a legend hold; and its highlights.

In a translucent part, a pixel shows several layers, whose colours average to grey. More opacity brings out
the front layer, but also hides the inside, of which enough has to stay visible.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import floor, log10
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from texgs.core.errors import ArgumentError
from texgs.core.keys import key
from texgs.edit.method import MethodKeys
from texgs.fields.part_edit import MAX_FACTOR, PartEdit

if TYPE_CHECKING:
    import torch
    from torch import Tensor

    from texgs.core.camera import Camera
    from texgs.edit.task import Task
    from texgs.fields.surfels.composition import Composition
    from texgs.fields.surfels.model import Surfels
    from texgs.scene.scene import Scene

AnyTask = TypeVar("AnyTask", bound="Task[Any]")
READABLE_ALPHA = 0.9  # mean alpha of a part above which its pattern is readable
MAX_READABLE_FACTOR = 16.0  # largest factor on opacity; larger ones change almost nothing
KEPT_SHARE = 0.5  # share of its pixels that every part must keep
SHOWN_SHARE = 0.1  # share of a pixel's colour above which it shows a part
VIEWS, SIZE = 6, 100  # number of views to measure visibility, and pixels of their sides
BISECTIONS = 5  # halvings of the interval of a share


@dataclass(frozen=True)
class ReadableKeys(MethodKeys):
    """How opaque parts become with their new look, and how far it leaves their hues."""

    opacity: str | None = key(
        None,
        "factor on the opacity of the parts, an edit of the scene that can be taken back: keep; a number; or "
        "auto, as much as makes a pattern readable and leaves visible what is inside; default auto, keep in "
        "recipe paper",
    )
    hue: float = key(
        1.0,
        "how far a look may leave the hue of the function that it lies on, as a share of the way to the most "
        "similar function: 0 keeps it, 1 leaves it free; lightness and texture are free",
        least=0,
        most=1,
    )

    def check(self) -> None:
        """Require words or a factor."""
        _ = self.factor
        super().check()

    @property
    def factor(self) -> float | None:
        """Return the factor, or None to choose it by the scene."""
        said = self.opacity or ("keep" if getattr(self, "recipe", "") == "paper" else "auto")
        if said in ("keep", "auto"):
            return 1.0 if said == "keep" else None
        try:
            factor = float(said)
        except ValueError:
            factor = -1.0
        if not 0 < factor <= MAX_FACTOR:
            raise ArgumentError(
                f"{self.node}.opacity: expected keep, auto or a factor above 0, up to {MAX_FACTOR:g}; "
                f"got {said!r:.60}"
            )
        return factor


def raise_opacities(task: AnyTask) -> AnyTask:
    """Raise the opacities in the task's scene as the look of its parts requires."""
    from texgs.edit.task import parts_of
    from texgs.scene.parts import entry_of, replace_entry

    scene, factor = task.scene, task.settings.factor
    parts = parts_of(scene, task.edit.parts)
    given = dict.fromkeys(parts, factor) if factor else readable_factors(scene, parts, task.device)
    for part, each in given.items():
        entry = entry_of(scene, part)
        edit = replace(entry.edit, opacity=min(each * entry.edit.opacity, MAX_FACTOR))
        scene = replace_entry(scene, part, replace(entry, edit=edit))
    return replace(task, scene=scene)


def readable_factors(scene: Scene, parts: Sequence[str], device: torch.device | str) -> dict[str, float]:
    """Return a factor on the opacity of each part that makes patterns on it readable.

    It raises the mean alpha of the part alone to `READABLE_ALPHA` and is at least 1. If this would hide half
    of the pixels of a visible part, all factors fall together, on a logarithmic scale.
    """
    sight = PartVisibility.of(scene, device)
    wanted = {part: sight.readable(part) for part in parts}
    before = sight.pixels({})

    def is_visible(share: float) -> bool:
        shown = sight.pixels({part: factor**share for part, factor in wanted.items()})
        return bool((shown >= KEPT_SHARE * before).all())

    share = largest(is_visible) if max(wanted.values()) > 1 else 0.0
    return {part: two_digits(factor**share) for part, factor in wanted.items()}


@dataclass(frozen=True, eq=False)
class PartVisibility:
    """The visibility of each part in a few views around a scene."""

    composed: Composition
    edits: Mapping[str, PartEdit]  # by part, in the order of the composition
    marks: Tensor  # [N, P] 1 for the part of each surfel
    cameras: Sequence[Camera]

    @classmethod
    def of(cls, scene: Scene, device: torch.device | str) -> PartVisibility:
        """Measure a scene of surfels in the frame of its pictures."""
        import torch

        from texgs.fields.surfels.composition import Composition
        from texgs.volume.cameras import icosphere_of

        opened = [entry.surfels() for entry in scene.models.values()]
        models, masks = [model.to(device) for model, _ in opened], [own for _, own in opened]
        composed = Composition(models, [[mask.to(device) for mask in own] for own in masks])
        names: list[str] = []
        numbers = []
        for part, (name, entry) in zip(composed.parts, scene.models.items(), strict=True):
            own = torch.zeros(len(part.model)).long().to(device) if part.labels is None else part.labels
            numbers.append(len(names) + own)
            names += [name, *(f"{name}/{segment}" for segment in entry.segments)]
        marks = torch.nn.functional.one_hot(torch.cat(numbers), len(names)).float()
        cameras = icosphere_of(2 * VIEWS, scene.framed(composed).lens().square(SIZE))[::2]
        edits = dict(zip(names, scene.edits, strict=True))
        return cls(composed, edits, marks, [camera.to(device) for camera in cameras])

    def readable(self, part: str) -> float:
        """Return the factor, at most `MAX_READABLE_FACTOR`, that makes a part readable by itself."""
        from texgs.edit.canvas import weighted_mean

        alone = {name: replace(edit, visible=name == part) for name, edit in self.edits.items()}

        def is_readable(share: float) -> bool:
            opacity = min(MAX_READABLE_FACTOR ** (1 - share) * alone[part].opacity, MAX_FACTOR)
            shares = self.shares({**alone, part: replace(alone[part], opacity=opacity)})
            return weighted_mean(each.sum(-1) for each in shares) >= READABLE_ALPHA

        return float(MAX_READABLE_FACTOR ** (1 - largest(is_readable)))

    def pixels(self, factors: Mapping[str, float]) -> Tensor:
        """Return the number of pixels [P] that show each part, with factors on some opacities."""
        import torch

        edits = {
            name: replace(edit, opacity=min(factors.get(name, 1.0) * edit.opacity, MAX_FACTOR))
            for name, edit in self.edits.items()
        }
        return torch.stack([(each > SHOWN_SHARE).sum(dim=(0, 1)) for each in self.shares(edits)]).sum(0)

    def shares(self, edits: Mapping[str, PartEdit]) -> Iterator[Tensor]:
        """Return the share [H, W, P] of each part in each pixel, view by view."""
        return (self.composed.shares(camera, [*edits.values()], self.marks) for camera in self.cameras)


def largest(holds: Callable[[float], bool]) -> float:
    """Return the largest share in [0, 1] for which the monotone `holds` is true."""
    if holds(1.0):
        return 1.0
    low, step = 0.0, 0.5
    for _ in range(BISECTIONS):
        low += step * holds(low + step)
        step /= 2
    return low


def two_digits(factor: float) -> float:
    """Round a factor of at least 1 down to two digits."""
    unit = 10.0 ** (floor(log10(factor)) - 1)
    return round(floor(factor / unit + 1e-9) * unit, 1)


# -- highlights ---


class Highlights(NamedTuple):
    """The highlights of a material."""

    specular: float  # k_s
    shininess: float  # beta
    tint: tuple[float, float, float] = PartEdit.tint


# By the names of the vocabulary. Tints of metals are their linear reflectance at normal incidence, at most 1
# (Akenine-Moeller et al. 2018, Real-Time Rendering, table 9.2).
MATERIALS = {
    "gold": Highlights(0.9, 20, (1.0, 0.782, 0.344)),
    "silver": Highlights(0.9, 25, (0.972, 0.960, 0.915)),
    "copper": Highlights(0.8, 18, (0.955, 0.638, 0.538)),
    "wood": Highlights(0.1, 8),
    "marble": Highlights(0.3, 30),
    "glass": Highlights(0.9, 60),
}


def highlights_of(instruction: str, model: Surfels, surfels: Tensor | None = None) -> dict[str, Any]:
    """Return values for a `PartEdit` with the highlights of the material that an instruction names.

    The factors bring the medians of the part's own k_s and beta, as fitted, to those of the material.

    Args:
        instruction: such as "make it gold"; if it says anything more, the result is {}.
        model: relightable.
        surfels: [N] bool, surfels of the part; all by default.
    """
    from texgs.fields.surfels.shading import material
    from texgs.models.instruction import understand

    try:
        named = MATERIALS.get(understand(instruction)[0])
    except ArgumentError:  # for a diffusion model to understand
        named = None
    if named is None:
        return {}
    own = material(model.parameters, model.shading.material)  # [N] or [1]
    edit: dict[str, Any] = {"tint": named.tint}
    for name in ("specular", "shininess"):
        values = own[name] if surfels is None or len(own[name]) == 1 else own[name][surfels]
        wanted, fitted = getattr(named, name), float(values.median())
        if fitted:  # no factor changes a zero
            edit[name] = min(wanted / fitted, MAX_FACTOR)
    return edit
