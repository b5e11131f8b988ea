"""Small models of every stage with values as a fit could leave them."""

import torch

from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import ShadingModel

STAGES = ("surfels", "shading", "texture")


def sample(
    stage: str = "texture", n: int = 7, *, degree: int = 3, shared: bool = False, seed: int = 0, **shading
):
    """A model of a stage; `shared` gives all surfels one material."""
    generator = torch.Generator().manual_seed(seed)

    def normal(*shape):
        return torch.randn(shape, generator=generator)

    p = {"means": normal(n, 3), "quats": normal(n, 4), "scales": normal(n, 2) - 4, "opacities": normal(n)}
    if stage == "surfels":
        p["sh"] = normal(n, (degree + 1) ** 2, 3)
    else:
        p["colors"] = torch.rand(n, 3, generator=generator)
        p |= {name: normal(1 if shared else n) for name in ("ambient", "diffuse", "specular", "shininess")}
    if stage == "texture":
        sizes = torch.randint(1, 6, (n, 2), generator=generator, dtype=torch.int32)
        counts = sizes.long().prod(1)
        p |= {"palette": torch.rand(3, generator=generator), "texels": normal(int(counts.sum()), 3)}
        p |= {"sizes": sizes, "offsets": counts.cumsum(0) - counts}
    return Surfels(
        p, ShadingModel(**shading), {"light": {"kind": "headlight"}, "bounds": [[-0.5, 0.1], [1e-7, 2]]}
    )


def same(one: Surfels, other: Surfels) -> bool:
    """Whether all tensors have the same names, types and bits."""
    return one.parameters.keys() == other.parameters.keys() and all(
        x.dtype == other.parameters[name].dtype
        and x.numpy().tobytes() == other.parameters[name].numpy().tobytes()
        and x.shape == other.parameters[name].shape
        for name, x in one.parameters.items()
    )
