"""Views of other steps of a series in time, which show surfels that the scene's own step hides."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.edit.canvas import few_cameras, visible_camera
from texgs.fields.surfels.model import Surfels

PLACE_TENSORS = ("means", "quats", "scales")
MOVING_TENSORS = (*PLACE_TENSORS, "normals", "opacities")  # tensors that change in a series
SWITCH_FACTOR = 4.0  # a surfel learns from another step that shows it so many times better


class Shot(NamedTuple):
    """Views of a step, and the surfels that learn from them."""

    model: Surfels
    cameras: Sequence[Camera]
    surfels: Tensor  # [N] bool


@torch.no_grad()
def where_shown(model: Surfels, steps: Sequence[Surfels], cameras: Sequence[Camera]) -> Surfels:
    """Return a model of a series with each surfel at the step where views show it best.

    Surfels move only if another step shows them much better. A picture laid onto them then stays whole on
    surfaces of the model, and on surfaces that appear later.
    """
    few = [visible_camera(model, camera.to(model.device)) for camera in few_cameras(cameras)]
    shown = torch.stack([weights_of(model_at_step(model, step), few) for step in (model, *steps)])
    shown[0] *= SWITCH_FACTOR
    best = shown.argmax(dim=0)
    rows = torch.arange(len(model), device=best.device)
    every = [model, *steps]
    chosen = {
        name: torch.stack([step.parameters[name] for step in every])[best, rows] for name in PLACE_TENSORS
    }
    return replace(model, parameters={**model.parameters, **chosen})


def weights_of(model: Surfels, cameras: Sequence[Camera]) -> Tensor:
    """Return the sum [N] of each surfel's blending weights over some views."""
    nothing = model.parameters["means"][:, :1]
    renders = (model.rasterized(each, features=nothing, outputs=("statistics",)) for each in cameras)
    return torch.stack([each.statistics.weight_sum for each in renders if each.statistics]).sum(0)


def model_at_step(model: Surfels, step: Surfels) -> Surfels:
    """Return a model with its surfels at the places of a step of its series."""
    moved = {name: x for name, x in step.parameters.items() if name in MOVING_TENSORS}
    return replace(model, parameters={**model.parameters, **moved})


@torch.no_grad()
def shots_of(
    model: Surfels, steps: Sequence[Surfels], cameras: Sequence[Camera], changing: Tensor
) -> list[Shot]:
    """Return views of a model for its changing surfels [N], and some of other steps, half as many as these.

    Each of the latter shows its surfels much better than all before it; the most useful come first.
    """
    shots = [Shot(model, cameras, changing)]
    if not steps:
        return shots
    few = few_cameras(cameras)
    others = [Shot(model_at_step(model, step), [camera], changing) for step in steps for camera in few]
    shown = [weights_of(each.model, each.cameras) for each in others]
    known = SWITCH_FACTOR * torch.stack([weights_of(model, [camera]) for camera in few]).amax(0)
    for _ in range(len(cameras) // 2):
        gains = [(weights - known).clamp_min(0) * changing for weights in shown]
        best = max(range(len(others)), key=lambda index: float(gains[index].sum()))
        shots.append(others[best]._replace(surfels=gains[best] > 0))
        known = known.maximum(SWITCH_FACTOR * shown[best])
    return [shot for shot in shots if bool(shot.surfels.any())]
