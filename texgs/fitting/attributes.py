"""Colours and normals that surfels have from their volume; fits learn how they differ from these."""

from collections.abc import Mapping
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn.functional import normalize

from texgs.volume.lookup import Lookup

NEIGHBOURS = 3
# Normals of neighbours are alike in smooth data: from the first mean cosine on, those of the volume are better
# than learned ones, and from the second on they are held with all strength. In noise, and where surfels are
# farther apart than a surface bends, views average many samples, which are better than one.
ALIKE, SAME = 0.96, 0.98
HOLD = 0.02  # the share of a difference that an iteration takes away, at most


@dataclass(frozen=True, eq=False)
class Attributes:
    """What a volume says of surfels, and how strongly their differences from it are held to 0."""

    lookup: Lookup
    hold: float  # share that an iteration takes away; 0: the volume is where they start, and no more

    def at(self, means: Tensor) -> dict[str, Tensor]:
        """Return `colors` [N, 3] and `normals` [N, 4], quaternions whose third axis is the gradient."""
        seen = self.lookup.at(means, ("colors", "quats"))
        return {"colors": seen["colors"], "normals": seen["quats"]}

    def added_to(self, parameters: Mapping[str, Tensor]) -> dict[str, Tensor]:
        """Return parameters in which differences from the volume are colours and normals."""
        own = self.at(parameters["means"])
        return {name: x + own[name] if name in own else x for name, x in parameters.items()}


def coherence(lookup: Lookup, means: Tensor) -> float:
    """Return how alike the volume's normals are from one surfel [N, 3] to the next: a mean cosine, 0 to 1.

    The light sees no difference between a normal and its opposite.
    """
    from scipy.spatial import cKDTree

    gradients = lookup.at(means, ("gradients",))["gradients"].cpu()
    normals, places = normalize(gradients, dim=1), means.detach().cpu().numpy()
    _, near = cKDTree(places).query(places, k=1 + NEIGHBOURS)
    cosines = (normals[:, None] * normals[torch.from_numpy(near[:, 1:])]).sum(dim=2)
    return float(cosines.abs().mean())


def hold_of(alike: float) -> float:
    """Return how strongly surfels are held to a volume of some coherence."""
    return HOLD * min(max((alike - ALIKE) / (SAME - ALIKE), 0.0), 1.0)
