"""Small models with values as a fit could leave them."""

import torch

from texgs.fields.gaussians import Baked, Gaussians


def sample(n=7, *, degree=3, seed=0, antialiased=False, **metadata):
    """Random Gaussians, about as wide as a tenth of a world unit, around the origin."""
    generator = torch.Generator().manual_seed(seed)

    def normal(*shape):
        return torch.randn(shape, generator=generator)

    parameters = {
        "means": 0.4 * normal(n, 3),
        "quats": normal(n, 4),
        "scales": 0.4 * normal(n, 3) - 2.3,
        "opacities": normal(n),
        "sh": 0.3 * normal(n, (degree + 1) ** 2, 3),
    }
    return Gaussians(parameters, Baked(antialiased), metadata or {"bounds": [[-0.5, 0.1], [1e-7, 2]]})
