"""The start of surfels: at given points, at ends of rays, at visible points, or at random."""

import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import normalize

from texgs.core.errors import ArgumentError, errors_at
from texgs.core.geometry import facing, nearest
from texgs.core.names import POINTS
from texgs.core.ply_file import read_vertices
from texgs.fields.ply_columns import take
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import ShadingModel, raw_material
from texgs.fitting.casting import RayEnds, ends_of_rays
from texgs.fitting.hull import Box, hull_points, mean_colors, random_points
from texgs.fitting.loop import Fit
from texgs.fitting.settings import Densify, Losses, Phase, Rates, Seeds
from texgs.raster.shading import MATERIAL
from texgs.volume.caster import Caster
from texgs.volume.grid import Grid
from texgs.volume.images import Images, shrink
from texgs.volume.render import Appearance
from texgs.volume.transfer import TransferFunction
from texgs.volume.view_set import ViewSet

MARGIN = 0.02  # around the box of the data, relative to its longest side
HALF_SIZE = 1.1  # of the default cube around the origin, in halves of the data's longest side
USUAL_SIDE = 1.0  # default for the longest side of data, world units
GREY = 0.5  # colour of random seeds
USUAL_COUNT = 10_000  # default number of seeds
NEIGHBOURS = 3  # their mean distance is a surfel's first scale
MIN_SCALE = 1e-4  # world units
# A quick fit of more surfels than needed finds the visible ones.
CANDIDATES = 2  # candidate seeds for each one kept
PIXELS = 200  # approximate longer side of small images
PHASE = Phase(
    iterations=100,
    rates=Rates(quats=0.016),
    losses=Losses(dssim=0.0, alpha=0.0),
    densify=Densify(start=0, stop=0),
)


def seed_surfels(
    images: Images,
    views: ViewSet,
    seeds: Seeds,
    seed: int,
    volume: Grid | None = None,
    most: int | None = None,
) -> tuple[dict[str, Tensor], Tensor]:
    """Return raw start `means`, `quats`, `scales` and `opacities` of surfels by name, and colours [N, 3].

    "points" are all in the folder's points3d.ply; "volume", where rays of views through it end, with its
    normals, see `ends_of_rays`: each part has its share, however thin or small; "hull", points that no view
    sees through; "visible", those of them that a quick fit finds to be seen, as hidden ones never show and
    still count under the cap of density control; "random", grey ones in the box; "auto", those of the volume
    if there is one, else visible. Opacity is that before the quick fit. Of the half size see `box_of`. By
    default there are as many that show something as density control keeps, `most`.
    """
    kind, half_size = seeds.kind, seeds.half_size
    if not 0 < seeds.opacity < 1:
        raise ArgumentError(f"seeds.opacity: expected a value between 0 and 1, got {seeds.opacity}")
    if kind == "auto":
        kind = "volume" if volume is not None and "tf" in views.metadata else "visible"
    count = seeds.count or (most if kind in ("volume", "visible") else None) or USUAL_COUNT
    generator = torch.Generator().manual_seed(seed)
    if kind == "volume":
        ends = points_in(volume, views, images, count, seed)
        warn_of_fewer(views, len(ends.places), count)
        return surfels_on(ends, seeds.opacity, generator), ends.colors
    colors: Tensor | None = None
    if kind == "points":
        points, colors = read_points(views.folder / POINTS)
    elif kind == "random":
        points = random_points(box_of(views, half_size), count, generator)
        colors = torch.full_like(points, GREY)
    else:
        candidates = CANDIDATES * count if kind == "visible" else count
        points = hull_points(images, box_of(views, half_size), candidates, generator)
    if kind != "points":
        warn_of_fewer(views, len(points), count)
    if colors is None:
        colors = mean_colors(images, points)
    surfels = surfels_at(points, seeds.opacity, generator)
    if kind != "visible":
        return surfels, colors
    return most_seen(surfels, colors, images, count, seed)


def points_in(volume: Grid | None, views: ViewSet, images: Images, most: int, seed: int) -> RayEnds:
    """Return the ends of rays of all views in their volume."""
    if volume is None or "tf" not in views.metadata:
        raise ArgumentError(
            f"{views.folder}: seeds.kind=volume needs a volume and views that name their transfer function; "
            "seeds.kind=visible needs neither"
        )
    caster, appearance, tf = shown_volume(volume, views)
    return ends_of_rays(caster, appearance, tf, images.cameras, most, seed)


def shown_volume(
    volume: Grid, views: ViewSet, device: torch.device | str = "cpu"
) -> tuple[Caster, Appearance, TransferFunction]:
    """Return a caster of a volume, with the appearance and the function of its views."""
    told, named = views.metadata, views.metadata["tf"]
    shading = {name: told["shading"][name] for name in MATERIAL if name in (told.get("shading") or {})}
    appearance = Appearance(**shading, opacity_unit=told.get("opacity_unit", Appearance.opacity_unit))
    points = {key: named[key] for key in named if key != "name"} if isinstance(named, Mapping) else named
    return Caster(volume, appearance, device), appearance, TransferFunction.from_dict(points)


def warn_of_fewer(views: ViewSet, found: int, count: int) -> None:
    """Warn on stderr if there are fewer seeds than requested."""
    if found < count:
        what = "so that thin and small parts may be missing; larger views have room for more"
        print(f"{views.folder}: found {found:,} of {count:,} seeds, {what}", file=sys.stderr)


def box_of(views: ViewSet, half_size: float | None) -> Box:
    """Return the box of the data with a margin, or a cube around its middle.

    Half the side of the cube is in halves of the data's longest side. Views that do not tell the box show
    data around the origin with a longest side of 1, as published ones do.
    """
    aabb = views.metadata.get("aabb")
    if aabb is None:
        corner = torch.full((3,), (half_size or HALF_SIZE) * USUAL_SIDE / 2)
        return -corner, corner
    try:
        low, high = torch.tensor(aabb, dtype=torch.float32).reshape(2, 3)
    except (TypeError, ValueError, RuntimeError) as error:
        raise ArgumentError(f"{views.folder}: aabb: expected two corners [2, 3], got {aabb}") from error
    if not bool((low <= high).all()):  # NaN ends here too
        raise ArgumentError(f"{views.folder}: aabb: expected the lowest corner, then the highest, got {aabb}")
    longest = (high - low).max()
    if half_size is None:
        return low - MARGIN * longest, high + MARGIN * longest
    middle, side = (low + high) / 2, half_size * longest / 2
    return middle - side, middle + side


def read_points(path: Path) -> tuple[Tensor, Tensor | None]:
    """Read points [N, 3] and, if any, colours [N, 3] in [0, 1] of a PLY file."""
    if not path.exists():
        raise ArgumentError(f"{path}: no such file; seeds.kind=visible needs no points")
    vertices = read_vertices(path)
    with errors_at(path):
        points = take(vertices, "x", "y", "z")
        is_colored = {"red", "green", "blue"} <= set(vertices.dtype.names or ())
        colors = take(vertices, "red", "green", "blue") if is_colored else None
    if not bool(points.isfinite().all()):
        raise ArgumentError(f"{path}: expected finite x, y and z, got NaN or infinity; remove those points")
    if colors is None:
        return points, None
    most = 1.0 if vertices.dtype["red"].kind == "f" else 255.0
    if not bool(((colors >= 0) & (colors <= most)).all()):
        raise ArgumentError(
            f"{path}: expected colours from 0 to {most:g}, as {vertices.dtype['red']} they are, got "
            f"{float(colors.min()):g} to {float(colors.max()):g}"
        )
    return points, colors / most


def surfels_at(points: Tensor, opacity: float, generator: torch.Generator) -> dict[str, Tensor]:
    """Return raw geometry of round surfels at points [N, 3], sized by distance, turned at random."""
    if len(points) <= NEIGHBOURS:
        raise ArgumentError(f"seeds: expected at least {NEIGHBOURS + 1} points, got {len(points)}")
    distances = nearest(points, points, NEIGHBOURS + 1)[0].numpy()
    scale = torch.from_numpy(np.sqrt(np.mean(distances[:, 1:] ** 2, axis=1))).float().clamp_min(MIN_SCALE)
    return {
        "means": points.float(),
        "quats": normalize(torch.randn(len(points), 4, generator=generator), dim=1),
        "scales": scale.log()[:, None].repeat(1, 2),
        "opacities": torch.full((len(points),), opacity).logit(),
    }


def surfels_on(points: RayEnds, opacity: float, generator: torch.Generator) -> dict[str, Tensor]:
    """Return raw geometry of round surfels at points, which face along their normals."""
    return {**surfels_at(points.places, opacity, generator), "quats": facing(points.normals)}


def most_seen(
    surfels: Mapping[str, Tensor], colors: Tensor, images: Images, count: int, seed: int
) -> tuple[dict[str, Tensor], Tensor]:
    """Fit surfels briefly, and return the `count` that contribute most to all views."""
    small = shrink(images, max(images.planes.shape[2:]) // PIXELS)
    start = {**surfels, "colors": colors, **raw_material(0.5, 0.5, 0.1, 20.0, "bounded")}
    fit = Fit(start, ShadingModel(), small, PHASE, seed)
    for _ in fit.run():
        pass
    fitted = {name: x.detach() for name, x in fit.parameters.items()}
    best = visible_weights(Surfels(fitted), small).topk(min(count, len(colors))).indices
    return {name: fitted[name][best] for name in surfels}, fitted["colors"][best].clamp(0, 1)


@torch.no_grad()
def visible_weights(model: Surfels, images: Images) -> Tensor:
    """Sum the blending weights [N] of each surfel over all pixels of all views."""
    total = torch.zeros(len(model), device=model.device)
    for camera, light in zip(images.cameras, images.lights, strict=True):
        statistics = model.render(camera.to(model.device), light, outputs=("statistics",)).statistics
        total += statistics.weight_sum  # type: ignore[union-attr]
    return total
