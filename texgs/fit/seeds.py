"""Where surfels start: at given points, where views show something, in their hull, or anywhere."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from texgs.core.errors import ArgumentError
from texgs.core.names import POINTS
from texgs.core.ply_file import read_vertices
from texgs.fields.harmonics import split, zeroth
from texgs.fit.hull import Box, hull_points, mean_colors, random_points
from texgs.fit.settings import SEEDS, Seeds
from texgs.fit.visible import CANDIDATES, most_seen
from texgs.volume.grid import Grid
from texgs.volume.images import Images
from texgs.volume.isosurface import visible_voxels
from texgs.volume.transfer import TransferFunction
from texgs.volume.view_set import ViewSet

MARGIN = 0.02  # of the box around the data, relative to its longest side
HALF_SIZE = 0.55  # of the cube around the origin where nothing else is known, world units
NEIGHBOURS = 3  # whose mean distance is a surfel's first scale
SMALLEST = 1e-4  # scale, world units


def seed_surfels(
    images: Images,
    views: ViewSet,
    kind: str,
    count: int,
    opacity: float,
    half_size: float | None,
    seed: int,
    volume: Grid | None = None,
) -> tuple[dict[str, Tensor], Tensor]:
    """Raw geometry of the first surfels, and their colours.

    Surfels that opaque matter hides never show, and still count under the cap of density control: "visible"
    starts without them.

    Args:
        images: training views.
        views: the same with their folder and metadata.
        kind: "points" in the folder's points3d.ply, all of them; "hull", points that no view sees through;
            "visible", those of them that a quick fit finds to be seen; "voxels", the same from the volume's
            samples that the views' transfer function shows; "random" in the box; "auto", points if there are
            any, else visible.
        count: of surfels; points are taken as they are.
        opacity: of each, between 0 and 1; for "visible", before the quick fit.
        half_size: half the side of the cube that seeds are in, in halves of the longest side of the data, the
            views' `aabb`; in world units where they have none. By default the box of the data, or a cube.
        seed: of random numbers; the same one gives the same surfels.
        volume: that the views show; for "voxels".

    Returns:
        `means`, `quats`, `scales` and `opacities` by name, and colours [N, 3] in [0, 1].

    Raises:
        ArgumentError: if an argument is out of range, there are no points, or the views show nothing.
    """
    if kind not in SEEDS:
        raise ArgumentError(f"seeds.kind: expected one of {', '.join(SEEDS)}, got {kind!r}")
    if not 0 < opacity < 1:
        raise ArgumentError(f"seeds.opacity: expected a value between 0 and 1, got {opacity}")
    given = views.folder / POINTS
    if kind == "auto":
        kind = "points" if given.is_file() else "visible"
    generator = torch.Generator().manual_seed(seed)
    colors: Tensor | None = None
    if kind == "points":
        points, colors = read_points(given)
    elif kind == "voxels":
        points, colors = shown_voxels(volume, views, CANDIDATES * count, seed)
    elif kind == "random":
        points = random_points(box_of(views, half_size), count, generator)
    else:
        candidates = CANDIDATES * count if kind == "visible" else count
        points = hull_points(images, box_of(views, half_size), candidates, generator)
    if colors is None:
        colors = mean_colors(images, points)
    surfels = surfels_at(points, opacity, generator)
    if kind not in ("visible", "voxels"):
        return surfels, colors
    return most_seen(surfels, colors, images, count, seed)


def seed_gaussians(images: Images, views: ViewSet, seeds: Seeds, degree: int, seed: int) -> dict[str, Tensor]:
    """Return raw parameters of the first Gaussians: as surfels start, as thick as they are wide.

    `sh` is apart from `sh_rest`, as they learn at different rates.

    Args:
        images: training views.
        views: the same with their folder and metadata.
        seeds: where; "voxels" needs a volume and is refused.
        degree: of the spherical harmonics, those above the zeroth being zero.
        seed: of random numbers.
    """
    surfels, colors = seed_surfels(images, views, **asdict(seeds), seed=seed)
    thickness = surfels["scales"].amin(dim=1, keepdim=True)  # seeds of surfels are round, or nearly so
    zeros = torch.zeros(len(colors), (degree + 1) ** 2 - 1, 3)
    sh = torch.cat([zeroth(colors), zeros], dim=1)
    return {**surfels, "scales": torch.cat([surfels["scales"], thickness], dim=1), **split(sh)}


def shown_voxels(volume: Grid | None, views: ViewSet, count: int, seed: int) -> tuple[Tensor, Tensor]:
    """Points and colours [N, 3] of a volume where the views' transfer function shows it."""
    if volume is None or "tf" not in views.metadata:
        raise ArgumentError(
            f"{views.folder}: seeds.kind=voxels needs a volume and views that name their transfer function; "
            "seeds.kind=visible needs neither"
        )
    named = views.metadata["tf"]
    points = {key: named[key] for key in named if key != "name"} if isinstance(named, Mapping) else named
    tf = TransferFunction.from_dict(points)
    points, colors = visible_voxels(volume, tf, count, seed)
    return torch.from_numpy(points), torch.from_numpy(colors)


def box_of(views: ViewSet, half_size: float | None) -> Box:
    """The box of the data with a margin, or a cube around its middle, see `seed_surfels`."""
    if half_size is not None and not half_size > 0:
        raise ArgumentError(f"seeds.half_size: expected more than 0, got {half_size}")
    aabb = views.metadata.get("aabb")
    if aabb is None:
        corner = torch.full((3,), float(half_size or HALF_SIZE))
        return -corner, corner
    try:
        low, high = torch.tensor(aabb, dtype=torch.float32).reshape(2, 3)
    except (TypeError, ValueError, RuntimeError) as error:
        raise ArgumentError(
            f"{views.folder}: aabb: expected two corners of three numbers, got {aabb}"
        ) from error
    if not bool((low <= high).all()):  # NaN ends here too
        raise ArgumentError(f"{views.folder}: aabb: expected the lowest corner, then the highest, got {aabb}")
    longest = (high - low).max()
    if half_size is None:
        return low - MARGIN * longest, high + MARGIN * longest
    middle, side = (low + high) / 2, half_size * longest / 2
    return middle - side, middle + side


def read_points(path: Path) -> tuple[Tensor, Tensor | None]:
    """Points [N, 3] and, where the file has them, colours [N, 3] in [0, 1] of a PLY file."""
    if not path.exists():
        raise ArgumentError(f"{path}: no such file; seeds.kind=visible needs no points")
    vertices = read_vertices(path)
    names = vertices.dtype.names or ()
    if missing := [name for name in "xyz" if name not in names]:
        raise ArgumentError(f"{path}: expected vertices with x, y and z, found no {', '.join(missing)}")
    if text := [name for name in names if vertices.dtype[name].kind not in "iuf"]:
        raise ArgumentError(f"{path}: expected vertices with numbers, got lists: {', '.join(text)}")
    points = columns(vertices, ("x", "y", "z"))
    if not bool(points.isfinite().all()):
        raise ArgumentError(f"{path}: expected finite x, y and z, got NaN or infinity; remove those points")
    if not {"red", "green", "blue"} <= set(names):
        return points, None
    colors = columns(vertices, ("red", "green", "blue"))
    most = 1.0 if vertices.dtype["red"].kind == "f" else 255.0
    if not bool(((colors >= 0) & (colors <= most)).all()):
        raise ArgumentError(
            f"{path}: expected colours from 0 to {most:g}, as {vertices.dtype['red']} they are, got "
            f"{float(colors.min()):g} to {float(colors.max()):g}"
        )
    return points, colors / most


def columns(vertices: np.ndarray, names: tuple[str, ...]) -> Tensor:
    """Columns of a table as [N, names], float32."""
    return torch.from_numpy(np.stack([vertices[name].astype(np.float32) for name in names], axis=1))


def surfels_at(points: Tensor, opacity: float, generator: torch.Generator) -> dict[str, Tensor]:
    """Raw geometry of round surfels at points: sized by the distance to neighbours, turned at random.

    Args:
        points: [N, 3] world units, at least four.
        opacity: of each.
        generator: of random numbers.
    """
    from scipy.spatial import cKDTree

    if len(points) <= NEIGHBOURS:
        raise ArgumentError(f"seeds: expected at least {NEIGHBOURS + 1} points, got {len(points)}")
    places = points.double().numpy()
    distances, _ = cKDTree(places).query(places, k=NEIGHBOURS + 1)
    scale = torch.from_numpy(np.sqrt(np.mean(distances[:, 1:] ** 2, axis=1))).float().clamp_min(SMALLEST)
    return {
        "means": points.float(),
        "quats": torch.nn.functional.normalize(torch.randn(len(points), 4, generator=generator), dim=1),
        "scales": scale.log()[:, None].repeat(1, 2),
        "opacities": torch.full((len(points),), opacity).logit(),
    }
