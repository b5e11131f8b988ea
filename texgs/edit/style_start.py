"""The start colours of a stylisation: close to the style already, they save most of the iterations.

Pictures are projected onto surfaces by place and normal, in chunks that keep strokes whole, as in StyleBlit.
"""

from collections.abc import Mapping, Sequence

import torch
from torch import Tensor
from torch.nn import functional as F

from texgs.core import check
from texgs.core.camera import Camera
from texgs.core.geometry import quats_to_matrices
from texgs.edit.recipe import Start
from texgs.edit.style_picture import StylePicture
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.texels import EXTENT, bare_colors, owners

MIN_VARIANCE = 1e-10  # added to the eigenvalues of covariances
CELLS = (0.25, 0.5, 1.0)  # sides of cells that may share a chunk, in longer sides of the picture
MIN_COSINE = 0.8  # cosine between the normal of a surfel and the mean normal of its chunk
MAX_DRIFT = 0.125  # largest distance between a surfel's own place and that in its chunk, in longer sides
RIM = 0.98  # readable part of a sphere's radius; the last pixels contain background
MAX_CELLS = 1 << 16  # cells along an axis
TEXELS = 1 << 18  # texels at a time
# What the picture shows to the right and down, where a surface faces x, y or z: (z, -y), (x, z), (x, -y).
RIGHT, DOWN = ((0.0, 0, 1), (1, 0, 0), (1, 0, 0)), ((0.0, -1, 0), (0, 0, 1), (0, -1, 0))


def start_colors(
    kind: Start, model: Surfels, style: StylePicture, pixel: float, seed: int, changing: Tensor | None = None
) -> Tensor:
    """Return colours of all texels [T, 3] in [0, 1], without light.

    The style has the size at which it is laid onto the surface, where a pixel of it has a side in world
    units. Colours that are moved to those of the style are those of changing texels [T], by default of all.
    """
    p = model.parameters
    if kind in ("projected", "sphere"):
        return projected_colors(p, style.image, pixel, sphere=kind == "sphere")
    if kind == "mean":
        return style.mean.expand_as(p["texels"]).contiguous()
    if kind == "random":
        pixels = style.pixels
        generator = torch.Generator().manual_seed(seed)
        chosen = torch.randint(len(pixels), (len(p["texels"]),), generator=generator)
        return pixels[chosen.to(pixels.device)]
    own = bare_colors(model).clamp(0, 1)
    matrix, shift = color_map(own if changing is None else own[changing], style.pixels)
    return (own @ matrix.T.to(own) + shift.to(own)).clamp(0, 1)


def pixel_side(model: Surfels, cameras: Sequence[Camera]) -> float:
    """Return the side of a pixel at the model's middle, mean over cameras, world units."""
    middle = model.parameters["means"].mean(0)
    sides = []
    for camera in cameras:
        viewmat, K = (x.to(middle) for x in (camera.viewmat, camera.K))
        sides.append((viewmat[2, :3] @ middle + viewmat[2, 3]).abs() / K[1, 1])
    return float(torch.stack(sides).mean())


def color_map(colors: Tensor, style: Tensor) -> tuple[Tensor, Tensor]:
    """Return the affine map x -> A x + b that gives colours [N, 3] the mean and covariance of others [M, 3].

    With S the covariances and m the means, A = S_style^(1/2) S_colors^(-1/2) and b = m_style - A m_colors
    (Zhang et al. 2022, supplement; symmetric square roots), float64. Not differentiable.
    """
    from kornia.enhance import zca_mean

    for name, x in (("colors", colors), ("style", style)):
        check.shape(name, x, "N 3")
    (whiten, mean, _), (whiten_style, mean_style, _) = (
        zca_mean(x.detach().double(), unbiased=False, eps=MIN_VARIANCE) for x in (colors, style)
    )
    matrix = torch.linalg.solve(whiten_style, whiten)
    return matrix, mean_style[0] - matrix @ mean[0]


@torch.no_grad()
def projected_colors(
    parameters: Mapping[str, Tensor], picture: Tensor, pixel: float, sphere: bool = False
) -> Tensor:
    """Return the colour of every texel [T, 3] from a picture [3, h, w] that is mirrored beyond its edges.

    A surfel reads the picture where its place falls on it, seen along the axis that it faces most. Neighbours
    that face about the same way share a chunk: a plane onto which the picture is laid without stretching.
    Chunks are as large as curvature lets them be (Sykora et al. 2019, in the world instead of an image).

    With `sphere` the picture shows a sphere that fills its shorter side, seen from +z. A surfel reads it
    where the sphere has its normal in the world, on the side away from the middle of all surfels; what faces
    -z has the colours of what faces +z. Chunks are parts of the sphere.

    A pixel has a side in world units. Texels that no surfel owns are black.
    """
    check.shape("picture", picture, "3 h w")
    p, (height, width) = parameters, picture.shape[1:]
    axes = quats_to_matrices(p["quats"])  # [N, 3, 3], columns are both tangents and the normal
    places, normals = p["means"] / pixel, axes[:, :, 2]
    radius = RIM * min(height, width) / 2 if sphere else torch.inf
    alone = on_sphere(places, normals, radius) if sphere else on_planes(places, normals)
    middles, planes = in_chunks(places, *alone, max(height, width))
    steps = planes @ axes[:, :, :2] * (p["scales"].exp() * EXTENT / p["sizes"] / pixel)[:, None]
    return read_texels(p, picture, middles, steps, radius)


def read_texels(
    parameters: Mapping[str, Tensor], picture: Tensor, middles: Tensor, steps: Tensor, radius: float
) -> Tensor:
    """Return the colour of every texel [T, 3] of surfels whose middles [N, 2] are on a picture [3, h, w].

    Steps [N, 2, 2] have in their columns how far it is from a texel to the next of a row, and to the next
    row. All are in pixels right and down from the picture's middle; what is beyond a radius is read there.
    """
    p, half = parameters, steps.new_tensor(picture.shape[:0:-1]) / 2
    first = middles - (steps * (p["sizes"][:, None] - 1)).sum(2) / 2  # [N, 2] the first texel of each
    across, along = (x.contiguous() for x in steps.unbind(2))
    colors = torch.zeros_like(p["texels"])
    for texel, surfel in zip(*(x.split(TEXELS) for x in owners(p)), strict=True):
        within, columns = texel - p["offsets"][surfel], p["sizes"][:, 0].long()[surfel]
        column, row = (x.to(first)[:, None] for x in (within % columns, within // columns))
        start, right, down = (x.index_select(0, surfel) for x in (first, across, along))
        at = start + column * right + row * down
        if radius < torch.inf:
            at = at * (radius / at.norm(dim=1, keepdim=True).clamp_min(radius))
        grid = (at / half)[None, None]
        read = F.grid_sample(picture[None], grid, padding_mode="reflection", align_corners=False)
        colors.index_copy_(0, texel, read[0, :, 0].T)
    return colors


def on_planes(places: Tensor, normals: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Return normals [N, 3] on the side of an axis, where surfels alone read a picture [N, 2], their planes.

    A plane [N, 2, 3] says what the picture shows to the right and down: the same as across the axis that the
    normal is nearest to, turned the shortest way. Up is +y.
    """
    axis = normals.abs().argmax(1)
    ahead = F.one_hot(axis, 3).to(normals)
    normals = normals * (normals * ahead).sum(1, keepdim=True).sign()
    across = normals.new_tensor((RIGHT, DOWN))[:, axis].transpose(0, 1)  # [N, 2, 3]
    lean = across @ normals[:, :, None] / (1 + (normals * ahead).sum(1))[:, None, None]
    return normals, (across @ places[:, :, None])[:, :, 0], across - lean * (ahead + normals)[:, None]


def on_sphere(places: Tensor, normals: Tensor, radius: float) -> tuple[Tensor, Tensor, Tensor]:
    """Do as `on_planes` for the picture of a sphere with a radius in pixels: all planes face +z."""
    outward = (normals * (places - places.mean(0))).sum(1, keepdim=True).sign()
    plane = normals.new_tensor((RIGHT[2], DOWN[2]))
    normals = normals * outward
    return normals, radius * normals @ plane.T, plane.expand(len(places), 2, 3)


def in_chunks(
    places: Tensor, normals: Tensor, alone: Tensor, planes: Tensor, side: int
) -> tuple[Tensor, Tensor]:
    """Return where surfels read the picture [N, 2], and their planes [N, 2, 3], once they share chunks.

    A chunk has the surfels of a cell that face the same axis, and their mean place, normal and plane. A
    surfel stays in the largest chunk that suits it, or alone.
    """
    facing = torch.cat([normals, -normals], 1).argmax(1)
    rows = torch.cat([places, normals, alone, planes.flatten(1)], 1)  # [N, 14]
    shared = alone
    for share in CELLS:
        x, y, z = ((places / (share * side)).floor().long() % MAX_CELLS).unbind(1)
        _, chunk = (((x * MAX_CELLS + y) * MAX_CELLS + z) * 6 + facing).unique(return_inverse=True)
        count = chunk.bincount()[:, None]
        means = rows.new_zeros(len(count), rows.shape[1]).index_add_(0, chunk, rows) / count
        place, normal, at, plane = (each[chunk] for each in means.split((3, 3, 2, 6), 1))
        plane = F.normalize(plane.unflatten(1, (2, 3)), dim=2)
        at = at + (plane @ (places - place)[:, :, None])[:, :, 0]
        suits = (normals * F.normalize(normal, dim=1)).sum(1, keepdim=True) > MIN_COSINE
        suits &= (at - alone).norm(dim=1, keepdim=True) < MAX_DRIFT * side
        shared, planes = torch.where(suits, at, shared), torch.where(suits[..., None], plane, planes)
    return shared, planes
