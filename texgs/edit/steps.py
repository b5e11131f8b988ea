"""What edits learn from other steps of a series in time: these show what the scene's own step hides."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.edit.canvas import around, some
from texgs.fields.surfels.model import Surfels

PLACE = ("means", "quats", "scales")
MOVED = (*PLACE, "normals", "opacities")  # of surfels, in a series
BETTER = 4.0  # times as much as before: from then on, a surfel learns from another step


class Shot(NamedTuple):
    """Views of a step, and what learns from them."""

    model: Surfels
    cameras: Sequence[Camera]
    surfels: Tensor  # [N] bool


@torch.no_grad()
def where_shown(model: Surfels, steps: Sequence[Surfels], cameras: Sequence[Camera]) -> Surfels:
    """Return a model of a series whose surfels are where views show them most, at one step or another.

    They stay where they are unless another step shows them much better: a picture that is laid onto them is
    then whole on surfaces of the model, and on those that appear later.
    """
    few = [around(model, camera.to(model.device)) for camera in some(cameras)]
    shown = torch.stack([weights_of(placed(model, step), few) for step in (model, *steps)])
    shown[0] *= BETTER
    best = shown.argmax(dim=0)
    rows = torch.arange(len(model), device=best.device)
    every = [model, *steps]
    chosen = {name: torch.stack([step.parameters[name] for step in every])[best, rows] for name in PLACE}
    return replace(model, parameters={**model.parameters, **chosen})


def weights_of(model: Surfels, cameras: Sequence[Camera]) -> Tensor:
    """Return how much each surfel [N] shows in some views: the sum of its blending weights."""
    nothing = model.parameters["means"][:, :1]
    renders = (model.rasterized(each, features=nothing, outputs=("statistics",)) for each in cameras)
    return torch.stack([each.statistics.weight_sum for each in renders if each.statistics]).sum(0)


def placed(model: Surfels, step: Surfels) -> Surfels:
    """Return a model with its surfels where they are at a step of its series."""
    moved = {name: x for name, x in step.parameters.items() if name in MOVED}
    return replace(model, parameters={**model.parameters, **moved})


@torch.no_grad()
def shots_of(
    model: Surfels, steps: Sequence[Surfels], cameras: Sequence[Camera], changing: Tensor
) -> list[Shot]:
    """Return views of a model for its changing surfels [N], and some of other steps, half as many as these.

    Each of the latter shows its surfels much better than all before it; the most telling come first.
    """
    shots = [Shot(model, cameras, changing)]
    if not steps:
        return shots
    few = some(cameras)
    others = [Shot(placed(model, step), [camera], changing) for step in steps for camera in few]
    shown = [weights_of(each.model, each.cameras) for each in others]
    known = BETTER * torch.stack([weights_of(model, [camera]) for camera in few]).amax(0)
    for _ in range(len(cameras) // 2):
        gains = [(weights - known).clamp_min(0) * changing for weights in shown]
        best = max(range(len(others)), key=lambda index: float(gains[index].sum()))
        shots.append(others[best]._replace(surfels=gains[best] > 0))
        known = known.maximum(BETTER * shown[best])
    return [shot for shot in shots if bool(shot.surfels.any())]
