"""Inputs and outputs of the rasterizer besides plain tensors."""

from collections.abc import Collection
from dataclasses import dataclass

from torch import Tensor

from texgs.core.errors import ArgumentError, ShapeError

OUTPUTS = ("depth", "median", "normal", "distortion", "statistics")


@dataclass(frozen=True)
class Options:
    """How surfels and 3D Gaussians become fragments.

    The defaults are those of 2DGS (Huang et al. 2024) and its successors, and of 3DGS (Kerbl et al. 2023).
    The first four fields belong to the model: a scene fitted with one filter looks different under another.
    """

    low_pass: float = 2.0
    """k in rho = min(u^2 + v^2, k |pixel - centre|^2): no surfel looks narrower than a Gaussian of variance
    1/k px^2."""
    filter_sigma: float = 0.0
    """Centre of the low-pass filter: the middle of the projected box of so many sigma. 0 is the projected
    mean, 1 what gsplat does, 3 what the release of 2DGS does."""
    dilation: float = 0.3
    """px^2 above 0, added to the variances of 3D Gaussians on screen: none looks narrower than a pixel."""
    antialiased: bool = False
    """Take as much from the opacity of 3D Gaussians as the dilation adds to their area on screen: thin ones
    then look the same in images of every size (the antialiased variant of 3DGS, after Mip-Splatting)."""
    alpha_min: float = 1 / 255
    """Fragments with less alpha are skipped, and surfels with less opacity altogether. Above 0, except in the
    reference; at least 1e-6 for gradients of the median depth: fainter fragments vanish in float32."""
    transmittance_min: float = 1e-4
    """A pixel ends before the fragment that would leave less light than this."""
    near: float = 0.01
    """What is not farther than this camera z is skipped: surfels and 3D Gaussians by their mean, fragments of
    surfels by their intersection (the low-pass filter may still draw them). World units."""
    far: float = 100.0
    """Camera z that maps to 1 in the normalised depth of the distortion; it clips nothing. World units."""
    check_finite: bool = False
    """Look for NaN and infinite inputs first and report them by name; costs a pass over the inputs. Without
    it, a colour that is not finite reaches pixels beyond its surfel on the CPU, which blends whole blocks."""


DEFAULT_OPTIONS = Options()


@dataclass(frozen=True, eq=False)
class Texture:
    """Colours that vary over each surfel: fragment colour = base + gain * bilinear(texel).

    The texture of a surfel spans +-3 sigma along its two tangents. Texel (i, j), i along u and j along v, is
    `texels[offsets[n] + j * sizes[n, 0] + i]` and lies at u = 6 (i + 0.5) / sizes[n, 0] - 3 sigma; beyond the
    outermost texel centres the edge texel is replicated.

    No two surfels may share a texel: the gradients of both would have one place. Textures may come in any
    order, with gaps. It is checked on the CPU; a GPU would have to wait for the answer, but must not be given
    such textures either.
    """

    base: Tensor
    """[N, 3] colour added to every texel, such as an offset and a specular term."""
    gain: Tensor
    """[N] factor on every texel, such as ambient plus diffuse shading."""
    texels: Tensor
    """[T, 3] colours of all surfels, one surfel after the other."""
    sizes: Tensor
    """[N, 2] int32, texels along u and along v, each at least 1; at most 2^24 texels for one surfel."""
    offsets: Tensor
    """[N] int64, index of each surfel's first texel."""


@dataclass(frozen=True, eq=False)
class Statistics:
    """Contributions of each surfel to one image; without gradient."""

    weight_sum: Tensor
    """[N] sum of its blending weights over all pixels."""
    weight_max: Tensor
    """[N] largest of its blending weights, 0 where it is not seen."""
    pixels: Tensor
    """[N] number of pixels that it was blended into."""
    radii: Tensor
    """[N] half of the longer side, in pixels, of the box on screen in which its alpha can reach `alpha_min`;
    at most the image's diagonal; 0 where the surfel is skipped, and possibly where that box misses or
    just touches the image."""


@dataclass(frozen=True, eq=False)
class Render:
    """One view of the surfels. Images that `outputs` does not name are None."""

    color: Tensor
    """[H, W, C] blended colour or features over the background."""
    alpha: Tensor
    """[H, W] in [0, 1], sum of the blending weights."""
    depth: Tensor | None = None
    """[H, W] expected camera z of the ray-splat intersections, of 3D Gaussians that of their means, world
    units; 0 where alpha is 0."""
    median: Tensor | None = None
    """[H, W] camera z of the last fragment that more than half of the light reaches; 0 where none is."""
    normal: Tensor | None = None
    """[H, W, 3] blended unit normals in world axes, facing the camera; as long as alpha at most."""
    distortion: Tensor | None = None
    """[H, W] sum over pairs of fragments of w_i w_j (m_i - m_j)^2 with m the depth mapped to 0 (near) to
    1 (far)."""
    statistics: Statistics | None = None
    """Contribution of each surfel."""


def are_gaussians(scales: Tensor) -> bool:
    """Return whether scales [N, 2 or 3] belong to 3D Gaussians."""
    return scales.shape[1] == 3


def check_primitive(scales: Tensor, has_texture: bool, outputs: Collection[str]) -> None:
    """Require scales [N, 2] or [N, 3]; refuse textures and normals for 3D Gaussians."""
    if scales.ndim != 2 or scales.shape[1] not in (2, 3):
        hint = "2 draw surfels, 3 draw 3D Gaussians"
        raise ShapeError(f"scales: expected [N, 2] or [N, 3], got {list(scales.shape)}; {hint}")
    if not are_gaussians(scales):
        return
    if has_texture:
        raise ArgumentError(
            "texture: expected features for 3D Gaussians (scales [N, 3]), which have no surface; "
            "pass scales [N, 2] to draw surfels"
        )
    if "normal" in outputs:
        raise ArgumentError(
            "outputs: 3D Gaussians (scales [N, 3]) have no normal; leave it out, or draw surfels"
        )
