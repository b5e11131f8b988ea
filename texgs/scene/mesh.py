"""Surfaces of opaque scenes as triangles: rendered depth is fused and meshed by Open3D."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.io import write_atomic
from texgs.core.progress import progress
from texgs.raster import Render
from texgs.scene.export import VERTEX, fill

VOXEL = 1 / 256  # world units
TRUNCATION = 5.0  # voxels on each side of a surface that know their distance from it, as in 2DGS
LEAST_VIEWS = 1.0  # more views than this must have seen a voxel
FAR = 1e4  # world units: no depth is left out
BLOCKS = 1000  # of 8^3 voxels that have memory from the start, 10 MB; more are added


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles with a colour at each corner."""

    vertices: np.ndarray  # [V, 3] float32, world units
    triangles: np.ndarray  # [F, 3] int32, counter-clockwise seen from outside
    colors: np.ndarray  # [V, 3] uint8


def fuse(show: Callable[[Camera], Render], cameras: Sequence[Camera], voxel: float = VOXEL) -> Mesh:
    """The surface that views of a scene see, by fusion of their depth (Curless and Levoy 1996).

    Depth is where half of the light is left, as 2DGS has it for objects with a boundary; what is less opaque
    than that has no surface.

    Args:
        show: renders a view over black, with `median`.
        cameras: around the scene.
        voxel: edge of the grid's cells, world units.

    Raises:
        ArgumentError: if Open3D is not there, the voxel is no length, or no view sees a surface.
    """
    if not voxel > 0:
        raise ArgumentError(f"voxel: expected a length above 0, got {voxel}")
    o3d = open3d()
    volume = o3d.t.geometry.VoxelBlockGrid(
        attr_names=("tsdf", "weight", "color"),
        attr_dtypes=(o3d.core.float32,) * 3,
        attr_channels=((1,), (1,), (3,)),
        voxel_size=voxel,
        block_resolution=8,
        block_count=BLOCKS,
    )
    seen = False
    for camera in progress(cameras, title="fuse", unit="view"):
        with torch.no_grad():
            seen |= _integrate(o3d, volume, camera, show(camera))
    triangles = volume.extract_triangle_mesh(weight_threshold=LEAST_VIEWS) if seen else None
    if triangles is None or not len(triangles.vertex.positions):
        raise ArgumentError(
            "mesh: expected a surface that lets less than half of the light through, got none"
        )
    colors = triangles.vertex.colors.numpy().clip(0, 255).round().astype(np.uint8)
    return Mesh(
        triangles.vertex.positions.numpy(), triangles.triangle.indices.numpy().astype(np.int32), colors
    )


def write_mesh(path: str | Path, mesh: Mesh) -> Path:
    """Create or replace a binary PLY file in one step.

    Raises:
        ArgumentError: if the file cannot be written.
    """
    from plyfile import PlyData, PlyElement

    vertices = np.empty(len(mesh.vertices), VERTEX)
    fill(vertices, torch.from_numpy(mesh.vertices), torch.from_numpy(mesh.colors))
    faces = np.empty(len(mesh.triangles), [("vertex_indices", "<i4", (3,))])
    faces["vertex_indices"] = mesh.triangles
    elements = [PlyElement.describe(vertices, "vertex"), PlyElement.describe(faces, "face")]
    return write_atomic(path, PlyData(elements, byte_order="<").write)


def open3d() -> Any:
    """The library.

    Raises:
        ArgumentError: if it is not installed, or the system lacks a library that it needs.
    """
    try:
        import open3d
    except ImportError as error:
        raise ArgumentError(
            f"mesh: needs Open3D, which cannot be loaded ({error}); install the extra texgs[mesh], and on "
            "Linux the system's libusb-1.0"
        ) from error
    return open3d


def _integrate(o3d: Any, volume: Any, camera: Camera, render: Render) -> bool:
    """Add one view to a volume, if it sees a surface."""
    if render.median is None:
        raise ArgumentError("show: expected renders with median; ask for it in outputs")
    opaque = render.alpha > 0.5  # behind what is fainter the last fragment would be taken for a surface
    if not bool(opaque.any()):
        return False
    color = 255 * render.color / render.alpha.clamp_min(1e-6)[..., None]

    def image(values: Tensor) -> Any:
        return o3d.t.geometry.Image(o3d.core.Tensor(values.contiguous().cpu().numpy()))

    depth, picture = image((render.median * opaque)[..., None]), image(color)
    K, viewmat = (o3d.core.Tensor(x.double().cpu().numpy()) for x in (camera.K, camera.viewmat))
    limits = (1.0, FAR, TRUNCATION)  # depth is in world units already
    blocks = volume.compute_unique_block_coordinates(depth, K, viewmat, *limits)
    volume.integrate(blocks, depth, picture, K, K, viewmat, *limits)
    return True
