"""Edit views by a guidance and make the texels follow: all text-driven methods, as presets of one loop."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.light import HEADLIGHT, Light
from texgs.core.memory import require_memory
from texgs.edit.back_projection import seen_texels
from texgs.edit.exposures import Exposure, expose
from texgs.edit.followers import AdamFollower, Follower, SolveFollower
from texgs.edit.target_views import render_views, require_texture
from texgs.fields.optimizer import Rate
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.texels import bare_colors, owners, recolored
from texgs.models.guidance import EditViews, Guidance, require_edited
from texgs.models.instruction import require_instruction

PIXEL = 112  # bytes of memory for a pixel of a view: what the guidance sees, returns, and texels follow
SURFEL = 28  # and for a surfel in a view at one opacity


@dataclass(frozen=True)
class Policy:
    """Which views are edited when, and how texels follow.

    Raises:
        ArgumentError: naming the value that is out of range.
    """

    rounds: int = 1  # how often views are edited and texels follow
    group: int | None = None  # views edited in a round, the next ones in turn; all by default
    opacities: tuple[float, ...] = (2.0, 1.0, 0.5)  # factors on the scene's opacity while texels are found
    sweeps: int = 3  # of the solver in a round, where there are no iterations
    iterations: int = 0  # of Adam in a round, over which opacities follow each other; 0: solve
    rate: float = 0.025  # of Adam at the start
    final: float = 0.1  # at the end, relative to that

    def __post_init__(self) -> None:
        for name in ("rounds", "group", "sweeps"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise ArgumentError(f"{name}: expected at least 1, got {value}")
        if self.iterations < 0 or not (self.rate > 0 and self.final > 0):
            raise ArgumentError(
                "iterations, rate, final: expected 0 or more and above 0, got "
                f"{self.iterations}, {self.rate} and {self.final}"
            )
        if not self.opacities or not all(0 < factor < float("inf") for factor in self.opacities):
            raise ArgumentError(f"opacities: expected factors above 0, at least one, got {self.opacities}")


@dataclass(frozen=True, eq=False)
class Edited:
    """What an edit gives."""

    model: Surfels
    """With new texels and offsets of surfels; the rest is that of the model edited, bit for bit."""
    views: EditViews
    """As the guidance saw them, the last time each."""
    images: Tensor
    """[V, H, W, 3] as the guidance edited them, the last time each."""
    seen: float
    """Share of the texels that may change that edited views show at some opacity; others are made up."""


def update(
    model: Surfels,
    cameras: Sequence[Camera],
    guidance: Guidance,
    instruction: str,
    policy: Policy = Policy(),
    *,
    light: Light = HEADLIGHT,
    lit: bool | None = None,
    surfels: Tensor | None = None,
    seed: int = 0,
    title: str = "edit",
) -> Edited:
    """Edit a model by editing views of it (the paper's section Text-Driven NPSE; IN2N, IG2G and DGE alike).

    Geometry, material, lighting and palette stay as they are: views of any angle agree, however the
    edits differ. The model may be the result of an edit: its views show that (text prompt refinement). The
    opacity factors of the policy are those of the search only; the model keeps its own.

    Args:
        model: textured.
        cameras: of the views to edit, of one size, on the model's device.
        guidance: edits them.
        instruction: to the guidance.
        policy: which views when, and how texels follow.
        light: that shines on the scene while it is edited.
        lit: whether the guidance sees the scene with light, and texels make up for it, or bare colours,
            which light falls on afterwards; by default as the guidance wants it.
        surfels: [N] bool, which may change; all by default. Others keep their colours bit for bit.
        seed: of all random numbers; with the same one, machine and versions, results are the same.
        title: of progress bars.
    """
    require_texture(model)
    instruction = require_instruction(instruction)
    changing = _changing(model, surfels)
    shine = light if (guidance.lit if lit is None else lit) else None
    generator = torch.Generator().manual_seed(seed)
    size = cameras[0].width * cameras[0].height if cameras else 0
    needed = len(cameras) * (PIXEL * size + SURFEL * len(policy.opacities) * len(model))
    require_memory(needed, f"{len(cameras)} views that are edited", "edit fewer views, or smaller ones")
    colors = bare_colors(model)
    originals = render_views(model, colors, cameras, shine).images
    follower = _follower(model, policy, generator)
    own = colors
    moving = changing_texels(model, changing)[:, None]
    targets = _Targets(len(policy.opacities))
    for round_ in range(policy.rounds):
        ids = _group(round_, policy.group, len(cameras))
        views = render_views(model, colors, [cameras[i] for i in ids], shine, originals[ids])
        edited = require_edited(guidance(views, instruction, generator), views, guidance.name)
        targets.put(ids, views, edited, expose(model, views, edited, shine, policy.opacities, changing))
        name = title if policy.rounds == 1 else f"{title}, round {round_ + 1} of {policy.rounds}"
        colors = torch.where(moving, follower.follow(targets.rows, name), own)
    colors, weights = follower.finish(targets.rows)
    share = _share(weights, model, changing)
    return Edited(recolored(model, colors, changing), targets.views, targets.images, share)


class _Targets:
    """The latest edit of each view that has one."""

    def __init__(self, opacities: int) -> None:
        self.opacities = opacities
        self.latest: dict[int, tuple[EditViews, int, Tensor]] = {}
        self.exposures: dict[int, list[Exposure]] = {}

    def put(
        self, ids: Sequence[int], views: EditViews, edited: Tensor, exposures: list[list[Exposure]]
    ) -> None:
        """Replace those of some views."""
        for place, index in enumerate(ids):
            self.latest[index] = (views, place, edited[place])
            self.exposures[index] = [row[place] for row in exposures]

    @property
    def images(self) -> Tensor:
        """[V, H, W, 3] as edited, in the order of views."""
        return torch.stack([self.latest[index][2] for index in sorted(self.latest)])

    @property
    def views(self) -> EditViews:
        """What was edited, in the order of views."""
        newest = [self.latest[index][:2] for index in sorted(self.latest)]
        images, conditions, alphas, points, normals = (
            torch.stack([getattr(views, name)[place] for views, place in newest])
            for name in ("images", "conditions", "alphas", "points", "normals")
        )
        cameras = [views.cameras[place] for views, place in newest]
        return EditViews(images, conditions, alphas, points, normals, cameras)

    @property
    def rows(self) -> list[list[Exposure]]:
        """For each opacity the exposures of all views with an edit."""
        return [[each[k] for each in self.exposures.values()] for k in range(self.opacities)]


def changing_texels(model: Surfels, surfels: Tensor) -> Tensor:
    """Which texels [T] belong to some surfels [N], in their places in the list."""
    place, surfel = owners(model.parameters)
    mine = torch.zeros(len(model.parameters["texels"]), dtype=torch.bool, device=place.device)
    mine[place] = surfels[surfel]
    return mine


def _follower(model: Surfels, policy: Policy, generator: torch.Generator) -> Follower:
    """What makes texels follow."""
    if policy.iterations:
        rate = Rate(policy.rate, policy.final)
        return AdamFollower(model, policy.iterations, policy.rounds, rate, generator)
    return SolveFollower(model, policy.sweeps, generator)


def _group(round_: int, size: int | None, count: int) -> list[int]:
    """The views of a round: the next ones in turn."""
    if size is None or size >= count:
        return list(range(count))
    return [(round_ * size + k) % count for k in range(size)]


def _changing(model: Surfels, surfels: Tensor | None) -> Tensor:
    """Which surfels may change [N], bool."""
    n = len(model)
    if surfels is None:
        return torch.ones(n, dtype=torch.bool, device=model.device)
    check.shape("surfels", surfels, "N", N=n)
    if surfels.dtype != torch.bool or not bool(surfels.any()):
        raise ArgumentError(
            f"surfels: expected at least one that may change as bool, got {int(surfels.sum())} "
            f"of {surfels.dtype}; choose a segment that is not empty"
        )
    return surfels.to(model.device)


def _share(weights: Tensor, model: Surfels, changing: Tensor) -> float:
    """Share of the texels that may change that are seen."""
    share = float(seen_texels(weights)[changing_texels(model, changing)].double().mean())
    if share == 0:
        raise ArgumentError(
            "views: expected some that show what is to change, got none; choose other views "
            "(edit.text.views), or edit something that is less faint"
        )
    return share
