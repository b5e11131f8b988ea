"""Connected pieces of a segment: of several objects that look alike, only the one clicked on."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from texgs.fields.surfels.model import Surfels

REACH = 2.0  # standard deviations of both surfels, within which they touch
NEIGHBOURS = 16  # surfels that one is compared with


def pieces_at(model: Surfels, mask: Tensor, places: Tensor) -> Tensor:
    """The pieces of a segment [N] bool that hold a place.

    Two surfels of it touch if their means are within 2 standard deviations (the larger ones) of both
    together; a piece is what can be reached from one to the next. A place is in the piece of the nearest.

    Args:
        model: of any stage.
        mask: [N] bool, of one surfel at least.
        places: [P, 3] world units.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    chosen = mask.nonzero()[:, 0]
    means = model.parameters["means"][chosen].detach().cpu().numpy()
    reach = REACH * model.parameters["scales"][chosen].detach().exp().amax(dim=1).cpu().numpy()
    tree, count = cKDTree(means), len(means)
    distances, others = tree.query(means, k=range(1, min(NEIGHBOURS, count - 1) + 2))
    rows = np.repeat(np.arange(count), others.shape[1])
    touches = distances.ravel() <= reach[rows] + reach[np.minimum(others.ravel(), count - 1)]
    edges = (np.ones(int(touches.sum())), (rows[touches], others.ravel()[touches]))
    _, piece = connected_components(coo_array(edges, shape=(count, count)), directed=False)
    _, nearest = tree.query(places.detach().cpu().numpy())
    kept = torch.from_numpy(np.isin(piece, piece[nearest])).to(mask.device)
    largest = torch.zeros_like(mask)
    largest[chosen[kept]] = True
    return largest
