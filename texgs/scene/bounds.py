"""The ball around the primitives of models: the target of cameras if the data are unknown."""

from collections.abc import Sequence
from math import radians, sin

import numpy as np
import torch

from texgs.core.geometry import quats_to_matrices
from texgs.core.lens import ORIGIN, Frame, Lens
from texgs.fields.field import Composed, Field
from texgs.fields.gaussians import Gaussians, JoinedGaussians
from texgs.fields.splats import geometry
from texgs.fields.surfels.composition import Composition
from texgs.fields.surfels.model import Surfels

STRAY_SHARE = 0.01  # share of the farthest primitives, which bounds ignore
REACH = 2.0  # visible extent of a primitive, in standard deviations
MIN_RADIUS = 1e-3  # world units


def bounds_of(models: Sequence[Field]) -> Frame:
    """Return a ball that holds nearly all primitives of models.

    Fields without means have the bounds that the paper's cameras see: volumes are centred and scaled alike.
    """
    whole = [model.parameters for model in models if isinstance(model, Surfels | Gaussians) and len(model)]
    if not whole:
        paper = Lens()
        return Frame(list(ORIGIN), paper.radius * sin(radians(paper.fov_y / 2)))
    places = torch.cat([p["means"] for p in whole]).double().cpu().numpy()
    reach = torch.cat([p["scales"].exp().amax(dim=1) for p in whole]).double().cpu().numpy()
    center = np.quantile(places, [STRAY_SHARE, 1 - STRAY_SHARE], axis=0).mean(axis=0)
    ends = np.linalg.norm(places - center, axis=1) + REACH * reach
    return Frame(center.tolist(), max(float(np.quantile(ends, 1 - STRAY_SHARE)), MIN_RADIUS))


def span_of(
    models: Sequence[Field], framed: Frame, normal: Sequence[float], strays: float = 0.0
) -> tuple[float, float]:
    """Return the visible range of models along a normal, without a share of strays at each end.

    Fields without means count as the ball that is framed.
    """
    middle, ends = float(np.dot(framed.target, normal)), []
    for model in models:
        if isinstance(model, Surfels | Gaussians) and len(model):
            means, quats, scales, _ = geometry(model.parameters)
            along = means.new_tensor(normal)
            reach = (along @ quats_to_matrices(quats)[..., : scales.shape[1]] * scales).norm(dim=1)
            ends.append(torch.stack([means @ along - REACH * reach, means @ along + REACH * reach]))
    if not ends:
        return middle - framed.radius, middle + framed.radius
    low, high = torch.cat(ends, dim=1).double().cpu().numpy()
    return float(np.quantile(low, strays)), float(np.quantile(high, 1 - strays))


def models_of(composed: Composed) -> list[Field]:
    """Return the models with means in an open scene."""
    if isinstance(composed, Composition):
        return [part.model for part in composed.parts]
    return [*composed.fields] if isinstance(composed, JoinedGaussians) else []
