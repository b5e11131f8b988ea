"""The definitions of per-surfel shading in plain torch: any floating-point type, gradients by autograd."""

import math

import torch
from torch import Tensor
from torch.nn.functional import normalize

from texgs.core.geometry import quats_to_matrices


def blinn_phong(
    color: Tensor,
    ambient: Tensor,
    diffuse: Tensor,
    specular: Tensor,
    shininess: Tensor,
    means: Tensor,
    quats: Tensor,
    camera_position: Tensor,
    light: Tensor | None = None,
    *,
    facing: bool = False,
) -> tuple[Tensor, Tensor]:
    """Return the base [N, 3] and gain [N] of shaded surfels; see `texgs.raster.shading`."""
    n = quats_to_matrices(quats)[:, :, 2]  # [N, 3]
    v = normalize(camera_position - means, dim=-1)
    l = v if light is None else normalize(light, dim=-1).expand_as(v)  # noqa: E741 (the paper's letter)
    h = normalize(l + v, dim=-1)
    n_v, n_l, n_h = ((n * x).sum(-1) for x in (v, l, h))  # [N]
    if facing:
        side = torch.where(n_v < 0, -1, 1)
        n_l, n_h = (side * n_l).clamp_min(0), (side * n_h).clamp_min(0)
        lobe = torch.where(n_l > 0, n_h**shininess, 0)
    else:
        n_l, lobe = n_l.abs(), n_h.abs() ** shininess
    gain = ambient + diffuse * n_l
    return gain[:, None] * color + (specular * lobe)[:, None], gain


def spherical_harmonics(sh: Tensor, means: Tensor, camera_position: Tensor) -> Tensor:
    """Return the colours [N, 3] of sh [N, K, 3] seen from a point; see `texgs.raster.spherical_harmonics`."""
    basis = harmonics(normalize(means - camera_position, dim=-1))[:, : sh.shape[1]]  # [N, K]
    return torch.einsum("nk,nkc->nc", basis, sh).add(0.5).clamp_min(0)


def harmonics(direction: Tensor) -> Tensor:
    """Return the 16 real spherical harmonics of degree 0 to 3 at unit directions [N, 3], [N, 16].

    Polynomials of the direction times normalisation factors; every odd order has the sign -1, as in 3DGS.
    """
    x, y, z = direction.unbind(-1)
    xx, yy, zz = x * x, y * y, z * z
    terms = (
        (1 / 4, torch.ones_like(x)),
        (3 / 4, -y), (3 / 4, z), (3 / 4, -x),
        (15 / 4, x * y), (15 / 4, -y * z), (5 / 16, 2 * zz - xx - yy), (15 / 4, -x * z), (15 / 16, xx - yy),
        (35 / 32, -y * (3 * xx - yy)), (105 / 4, x * y * z), (21 / 32, -y * (4 * zz - xx - yy)),
        (7 / 16, z * (2 * zz - 3 * xx - 3 * yy)),
        (21 / 32, -x * (4 * zz - xx - yy)), (105 / 16, z * (xx - yy)), (35 / 32, -x * (xx - 3 * yy)),
    )  # fmt: skip
    return torch.stack([math.sqrt(square / math.pi) * polynomial for square, polynomial in terms], -1)
