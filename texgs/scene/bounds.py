"""The ball around the primitives of models: what cameras look at where the data are not known."""

from __future__ import annotations

from collections.abc import Sequence
from math import radians, sin

import numpy as np
import torch

from texgs.core.lens import ORIGIN, Frame, Lens
from texgs.fields.field import Composed, Field
from texgs.fields.gaussians.model import Gaussians, JoinedGaussians
from texgs.fields.surfels.composition import Composition
from texgs.fields.surfels.model import Surfels

STRAYS = 0.01  # part of the primitives, far from all others, that bounds leave out
REACH = 2.0  # standard deviations of a primitive that are visible
SMALLEST = 1e-3  # radius, world units


def bounds_of(models: Sequence[Field]) -> Frame:
    """Return a ball that holds nearly all primitives of models.

    Fields without means have the bounds that the paper's cameras see: volumes are centred and scaled alike.
    """
    places, reach = primitives_of(models)
    if not len(places):
        paper = Lens()
        return Frame(list(ORIGIN), paper.radius * sin(radians(paper.fov_y / 2)))
    center = np.quantile(places, [STRAYS, 1 - STRAYS], axis=0).mean(axis=0)
    ends = np.linalg.norm(places - center, axis=1) + reach
    return Frame(center.tolist(), max(float(np.quantile(ends, 1 - STRAYS)), SMALLEST))


def span_of(
    models: Sequence[Field], framed: Frame, normal: Sequence[float], share: float = 0.0
) -> tuple[float, float]:
    """Return from where to where models lie along a normal, but for a share of their primitives at each end.

    Fields without means count as the surface of the framed ball, whose slices of one height have one area.
    """
    places, reach = primitives_of(models)
    if not len(places):
        middle, half = float(np.dot(framed.target, normal)), (1 - 2 * share) * framed.radius
        return middle - half, middle + half
    along = places @ np.array(normal)
    return float(np.quantile(along - reach, share)), float(np.quantile(along + reach, 1 - share))


def primitives_of(models: Sequence[Field]) -> tuple[np.ndarray, np.ndarray]:
    """Return the means of primitives [N, 3], and how far around them they are visible [N]."""
    whole = [model.parameters for model in models if isinstance(model, Surfels | Gaussians)]
    if not whole:
        return np.empty((0, 3)), np.empty(0)
    places = torch.cat([p["means"] for p in whole]).double().cpu().numpy()
    reach = torch.cat([p["scales"].exp().amax(dim=1) for p in whole]).double().cpu().numpy()
    return places, REACH * reach


def models_of(composed: Composed) -> list[Field]:
    """Return the models of an open scene, as far as they have means."""
    if isinstance(composed, Composition):
        return [part.model for part in composed.parts]
    return [*composed.fields] if isinstance(composed, JoinedGaussians) else []
