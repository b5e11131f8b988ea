"""Surfaces of opaque scenes as triangles: rendered depth is fused on a lattice (Curless and Levoy 1996)."""

from collections.abc import Callable, Sequence
from math import inf
from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.memory import require_memory
from texgs.core.progress import progress
from texgs.fields.ply_columns import Told, colored_points, write_columns
from texgs.raster import Render
from texgs.raster.fusion import BLOCK, DepthView, Lattice
from texgs.volume.isosurface import Mesh, isosurface
from texgs.volume.space import Space

TRUNCATION = 5.0  # voxels to either side of a surface that store a distance, as in 2DGS; at most BLOCK
MIN_VIEWS = 1  # a voxel must be seen by more views
MIN_VOXEL = 1e-6  # world units; the longest side of a volume is 1
CLUSTERS, MIN_TRIANGLES = 50, 50  # number of the largest connected parts to keep, and their least size


def points(view: DepthView) -> Tensor:
    """Return the surface points [P, 3] at the pixels of a view, world units."""
    return view.camera.unproject(view.depth)[view.depth > 0]


def lattice_of(low: Tensor, high: Tensor, voxel: float) -> Lattice:
    """Return a lattice of voxels around the box from `low` to `high` [3]."""
    x, y, z = (int(n) for n in ((high - low) / (BLOCK * voxel)).ceil().long() + 1)
    what = f"a mesh of {BLOCK * x} x {BLOCK * y} x {BLOCK * z} voxels"
    require_memory(5 * 4 * x * y * z * BLOCK**3, what, "choose a larger voxel")
    return Lattice((x, y, z), low, voxel)


def fuse_view(lattice: Lattice, view: DepthView) -> None:
    """Update the voxels close to the surface in a view."""
    near = torch.zeros(lattice.blocks)
    near[((points(view) - lattice.lower) / (BLOCK * lattice.spacing)).long().unbind(1)] = 1
    blocks = F.max_pool3d(near[None], 3, stride=1, padding=1)[0].nonzero()
    lattice.add(view, blocks, TRUNCATION * lattice.spacing)


def zero_surface(lattice: Lattice) -> Mesh:
    """Return the zero level of the distance, in cells with all corners seen."""
    values = -lattice.distance.numpy()  # inside is positive
    mesh = isosurface(values, 0.0, (lattice.spacing,) * 3, tuple(lattice.lower.tolist()))
    seen = (lattice.views > MIN_VIEWS).float()
    whole = -F.max_pool3d(-seen[None], 2, stride=1)[0]
    cells = ((torch.from_numpy(mesh.corners).mean(1) - lattice.lower) / lattice.spacing).floor().long()
    kept = whole[tuple(cells.clamp_min(0).T.flip(0))] > 0
    return with_triangles(mesh, kept.numpy())


def colors_at(lattice: Lattice, places: np.ndarray) -> np.ndarray:
    """Return the colours [V, 3] of places [V, 3] on edges of the lattice, uint8."""
    last = BLOCK * torch.tensor(lattice.blocks) - 1
    grid = (torch.from_numpy(places) - lattice.lower) / lattice.spacing / last * 2 - 1
    volume = lattice.color[None].permute(0, 4, 1, 2, 3)
    colors = F.grid_sample(volume, grid.float()[None, :, None, None], align_corners=True)
    return colors[0, :, :, 0, 0].T.round().clamp(0, 255).to(torch.uint8).numpy()


def depth_views(show: Callable[[Camera], Render], cameras: Sequence[Camera]) -> list[DepthView]:
    """Render the surface in views of a scene. Matter that transmits more than half of the light has none.

    Args:
        show: renders a view over black, with `median` or else `depth`: where half of the light is left, as
            2DGS has it for objects with a boundary; or the mean, as its authors take it for 3D Gaussians.
        cameras: around the scene.
    """
    return [depth_view(show(camera), camera) for camera in progress(cameras, title="render", unit="view")]


def fuse(views: Sequence[DepthView], voxel: float) -> Mesh:
    """Fuse views of a scene into a coloured surface, without small specks.

    Args:
        views: see `depth_views`.
        voxel: edge of the lattice's cells, world units.

    Raises:
        ArgumentError: if the voxel is no length, or too large for what is there, or no view sees a surface.
        OutOfMemoryError: if there are too many voxels.
    """
    if not MIN_VOXEL <= voxel < inf:
        raise ArgumentError(f"voxel: expected a length of {MIN_VOXEL:g} or more, got {voxel}")
    boxes = [points(view).aminmax(dim=0) for view in views if bool(view.depth.any())]
    if not boxes:
        raise ArgumentError(
            "mesh: expected a surface that lets less than half of the light through, got none"
        )
    margin = (TRUNCATION + 1) * voxel
    low, high = (torch.stack(ends) for ends in zip(*boxes, strict=True))
    lattice = lattice_of(low.amin(0) - margin, high.amax(0) + margin, voxel)
    for view in progress(views, title="fuse", unit="view"):
        fuse_view(lattice, view)
    mesh = largest_clusters(zero_surface(lattice))
    if not len(mesh.triangles):
        raise ArgumentError(
            f"mesh: expected cells of {voxel:g} near a surface that several views see, got none; choose a "
            "smaller voxel, or more views"
        )
    return Mesh(mesh.vertices, mesh.triangles, colors_at(lattice, mesh.vertices))


@torch.no_grad()
def depth_view(render: Render, camera: Camera) -> DepthView:
    """Return the surface in a view, on the CPU; faint pixels have no surface."""
    depth = render.depth if render.median is None else render.median
    if depth is None:
        raise ArgumentError("show: expected renders with median or depth; ask for one in outputs")
    color = 255 * render.color.clamp_min(0) / render.alpha.clamp_min(1e-6)[..., None]
    opaque = depth * (render.alpha > 0.5)
    return DepthView(camera.to("cpu"), opaque.cpu(), color.clamp_max(255).round().to(torch.uint8).cpu())


def largest_clusters(mesh: Mesh) -> Mesh:
    """Remove specks from a mesh: keep its largest connected parts, as in 2DGS."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    count, (a, b, c) = len(mesh.vertices), mesh.triangles.T
    edges = coo_matrix((np.ones(2 * len(a)), (np.r_[a, b], np.r_[b, c])), shape=(count, count))
    cluster = connected_components(edges, directed=False)[1][a]  # of each triangle
    sizes = np.bincount(cluster) if len(cluster) else np.zeros(1, int)
    least = max(np.sort(sizes)[-CLUSTERS:][0], min(MIN_TRIANGLES, sizes.max()))
    return with_triangles(mesh, sizes[cluster] >= least)


def with_triangles(mesh: Mesh, kept: np.ndarray) -> Mesh:
    """Select triangles [F] bool and the vertices they use."""
    used, triangles = np.unique(mesh.triangles[kept], return_inverse=True)
    return Mesh(mesh.vertices[used], triangles.reshape(-1, 3).astype(np.int32))


def write_mesh(path: str | Path, mesh: Mesh, told: Told = None) -> Path:
    """Create or replace a binary PLY file in one step; a mesh without colours is grey."""
    colors = np.full_like(mesh.vertices, 200, dtype=np.uint8) if mesh.colors is None else mesh.colors
    columns = colored_points(torch.from_numpy(mesh.vertices), torch.from_numpy(colors))
    return write_columns(path, columns, mesh.triangles, told)


def place_mesh(mesh: Mesh, space: Space) -> Mesh:
    """Map a mesh from the world to a space; triangles stay counter-clockwise."""
    triangles = mesh.triangles[:, ::-1] if space.is_mirrored else mesh.triangles
    return Mesh(space.points(mesh.vertices).astype(np.float32), triangles, mesh.colors)
