"""A mesh with a texture: surfaces with the colours that views of a scene have of them.

Each triangle has half of a square of the texture. Squares have sides of powers of two and lie along a
Z-curve, large ones first: that leaves no gaps. Those of a size follow a Z-curve in space, too: a viewer that
draws small triangles reads beyond their edges, where it then finds much the same colours.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import normalize, pad

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError, DeviceError
from texgs.core.geometry import z_order_of
from texgs.core.progress import progress
from texgs.raster import Render
from texgs.raster.fusion import DepthView
from texgs.volume.isosurface import Mesh
from texgs.volume.space import Space

LEAST, PADDING = 4, 3  # texels of the smallest square, and of a square beyond a leg: triangles never mix
DEPTHS = 3.0  # cells between the surface and the depth of a view that sees it
LEAST_COSINE, SHARPNESS = 0.2, 8  # of the normal and the way to a view: where it counts, with which power
UNSEEN = 1e-4  # weight of the colours of vertices, which show where no view sees a texel
CHUNK = 2**20  # texels at a time


class Textured(NamedTuple):
    """Triangles with a texture."""

    vertices: np.ndarray  # [V, 3] float32
    normals: np.ndarray  # [V, 3] of length 1
    triangles: np.ndarray  # [F, 3] vertices, counter-clockwise seen from outside
    uv: np.ndarray  # [F, 3, 2] columns and rows from the top left, in (0, 1)
    picture: np.ndarray  # [S, S, 3] uint8
    open_edges: int  # of one triangle or more than two; a closed surface has none

    def placed(self, space: Space) -> Textured:
        """Map it from the world to a space; triangles stay counter-clockwise."""
        places, normals = space.points(self.vertices).astype(np.float32), self.normals @ space.turn.T
        order = slice(None, None, -1 if space.is_mirrored else 1)
        return self._replace(
            vertices=places, normals=normals, triangles=self.triangles[:, order], uv=self.uv[:, order]
        )

    def png(self) -> bytes:
        """Return the texture as a PNG file."""
        return cv2.imencode(".png", self.picture[..., ::-1])[1].tobytes()


def textured(mesh: Mesh, views: Sequence[DepthView], tolerance: float, faces: int, side: int) -> Textured:
    """Return a mesh with fewer triangles, and the mean colours of the views that see it, best from ahead.

    Args:
        mesh: with colours, fused from the views.
        views: without light.
        tolerance: between the surface and the depth of a view that sees it, world units.
        faces: most triangles; fewer by quadric errors (Garland and Heckbert 1997).
        side: of the texture, a power of two, texels.

    Raises:
        ArgumentError: if the texture is too small for the triangles.
    """
    import pyvista
    from scipy.spatial import KDTree

    surface = pyvista.PolyData.from_regular_faces(mesh.vertices, mesh.triangles)
    surface = surface.decimate(1 - faces / surface.n_cells) if surface.n_cells > faces else surface
    surface = surface.compute_normals(cell_normals=False, split_vertices=False, consistent_normals=False)
    vertices, normals = surface.points.astype(np.float32), surface["Normals"]
    triangles, uv, owner = unwrap(vertices, surface.regular_faces, side)
    colors = mesh.colors[KDTree(mesh.vertices).query(vertices)[1]]  # type: ignore[index]
    corners = [x[triangles].astype(np.float32) for x in (vertices, normals, colors)]
    picture, used = np.zeros((side, side, 3), np.uint8), np.flatnonzero(owner >= 0)
    for texels in progress(np.array_split(used, len(used) // CHUNK + 1), title="bake", unit="block"):
        own, middle = owner[texels], np.stack([texels % side, texels // side], axis=1) + 0.5
        legs = uv[own, 1, :1] - uv[own, 0, :1]  # negative in the second half of a square
        inside = ((middle - uv[own, 0]) / legs).clip(0)  # padding has what is nearest in the triangle
        inside /= inside.sum(axis=1, keepdims=True).clip(1)
        weights = np.column_stack([1 - inside.sum(axis=1), inside]).astype(np.float32)
        at = [torch.from_numpy(np.einsum("tk,tkc->tc", weights, x[own])) for x in corners]
        shown = seen_colors(at[0], at[1], at[2], views, tolerance)
        picture.reshape(-1, 3)[texels] = shown.numpy()
    return Textured(vertices, normals, triangles, uv / side, picture, surface.n_open_edges)


def unwrap(vertices: np.ndarray, triangles: np.ndarray, side: int) -> tuple[np.ndarray, ...]:
    """Give triangles places in a square texture, as large for their two shorter edges as there is room.

    Args:
        vertices: [V, 3].
        triangles: [F, 3] vertices of each.
        side: of the texture, a power of two, texels.

    Returns:
        The triangles [F, 3] in another order and turned; columns and rows of their corners [F, 3, 2], texels,
        those of the right angle first; and the triangle [side * side] of each texel, or -1.

    Raises:
        ArgumentError: if not even the smallest squares have room.
    """
    most = 2 * (side // LEAST) ** 2
    if len(triangles) > most:
        raise ArgumentError(f"faces: expected {most} at most in a texture of {side} texels; enlarge texture")
    edges = np.linalg.norm(vertices[triangles[:, [1, 2, 0]]] - vertices[triangles[:, [2, 0, 1]]], axis=2)
    legs, texel = np.sort(edges, axis=1)[:, 1], max(float(np.linalg.norm(edges)) / (2 * side), 1e-9)
    rank = z_order_of(torch.from_numpy(vertices[triangles].mean(axis=1))).argsort().numpy()
    while True:
        own = 2 ** np.ceil(np.log2(np.maximum(legs / texel + PADDING, LEAST))).astype(int)
        order = np.lexsort((rank, -own))
        sides = own[order[::2]]
        if np.square(sides).sum() <= side**2:
            break
        texel *= 1.02
    turned, half = (edges[order].argmax(axis=1)[:, None] + np.arange(3)) % 3, np.arange(len(order)) % 2
    codes, bits = (np.square(sides).cumsum() - np.square(sides)) // LEAST**2, np.arange(16)
    places = [LEAST * ((codes[:, None] >> (2 * bits + axis) & 1) << bits).sum(axis=1) for axis in (0, 1)]
    first, own = np.stack(places, axis=1), np.repeat(sides, 2)[: len(order), None, None]
    inside = 0.5 + (own - PADDING) * np.array([[0, 0], [1, 0], [0, 1]])
    uv = np.repeat(first, 2, axis=0)[: len(order), None] + np.where(half[:, None, None], own - inside, inside)
    owner = np.full((side, side), -1, np.int32)
    for size in np.unique(sides):
        squares, inner = np.flatnonzero(sides == size), np.indices((size, size))
        column, row = first[squares].T[:, :, None, None] + inner[:, None]
        owner[row, column] = 2 * squares[:, None, None] + (inner.sum(axis=0) >= size - 1)
    owner[owner >= len(order)] = -1
    return np.take_along_axis(triangles[order], turned, axis=1), uv, owner.ravel()


def seen_colors(
    points: Tensor, normals: Tensor, colors: Tensor, views: Sequence[DepthView], tolerance: float
) -> Tensor:
    """Return the mean colours [T, 3], uint8, that views have of points with normals [T, 3].

    `colors` [T, 3] are for points that no view sees.
    """
    normals, total = normalize(normals, dim=1), UNSEEN * pad(colors, (0, 1), value=1.0)
    for view in views:
        rays = view.camera.position - points
        cosine = (rays * normals).sum(1) / rays.norm(dim=1)
        ahead = (cosine > LEAST_COSINE).nonzero()[:, 0]
        pixels, z = view.camera.project(points[ahead])
        last = torch.tensor([view.camera.width, view.camera.height]) - 1
        column, row = pixels.long().clamp_min(0).minimum(last).unbind(1)
        near = (view.depth[row, column] - z).abs() <= tolerance
        seen = pad(view.color[row[near], column[near]].float(), (0, 1), value=1.0)
        total[ahead[near]] += cosine[ahead[near], None] ** SHARPNESS * seen
    return (total[:, :3] / total[:, 3:]).round().to(torch.uint8)


def notes_on(model: Textured, render: Callable[[Camera], Render], cameras: Sequence[Camera]) -> list[str]:
    """Say in sentences whether a textured mesh is closed, and how far it is from its scene."""
    closed = f"not closed: {model.open_edges:,} edges are open" if model.open_edges else "closed"
    what = f"{len(model.triangles):,} triangles, {closed}"
    try:
        level, lost = deviation(model, render, cameras)
    except DeviceError as error:
        return [f"{what}; how far it is from the scene is not known: {error}"]
    lacks = f"{100 * lost:.1f} % of the opacity is where it has no surface"
    return [f"{what}; {level:.1f} dB from the scene in {len(cameras)} views, and {lacks}"]


def deviation(
    model: Textured, render: Callable[[Camera], Render], cameras: Sequence[Camera]
) -> tuple[float, float]:
    """Return the PSNR of a textured mesh on what it or its scene shows, dB, and the share that it lacks.

    The mesh is drawn by VTK, without light, over white. The share is that of the scene's opacity.

    Raises:
        DeviceError: if there is no OpenGL.
    """
    import pyvista

    from texgs.volume.opengl import offscreen_opengl
    from texgs.volume.vtk_renderer import aim

    offscreen_opengl()
    numbers: Any = np.arange(model.triangles.size).reshape(-1, 3)
    surface = pyvista.PolyData.from_regular_faces(model.vertices[model.triangles].reshape(-1, 3), numbers)
    surface.active_texture_coordinates = (model.uv * [1, -1] + [0, 1]).reshape(-1, 2).astype(np.float32)
    plotter: Any = pyvista.Plotter(off_screen=True, lighting="none")
    plotter.ren_win.SetMultiSamples(0)
    texture = pyvista.Texture(model.picture)
    texture.interpolate = True
    plotter.add_mesh(surface, texture=texture, lighting=False)
    errors, alphas = [], []
    for camera in cameras:
        plotter.window_size = [camera.width, camera.height]
        aim(plotter.camera, camera)
        plotter.renderer.ResetCameraClippingRange()
        plotter.render()
        pixels = torch.from_numpy(np.array(plotter.screenshot(transparent_background=True, return_img=True)))
        is_drawn, seen = pixels[..., 3] > 0, render(camera)
        drawn = torch.where(is_drawn[..., None], pixels[..., :3] / 255, 1.0)
        shown = (seen.color + 1 - seen.alpha[..., None]).clamp(0, 1).cpu()
        errors.append((shown - drawn)[is_drawn | (seen.alpha.cpu() > 0.01)].square())
        alphas.append(torch.stack([seen.alpha.sum().cpu(), (seen.alpha.cpu() * ~is_drawn).sum()]))
    plotter.close()
    whole, lost = torch.stack(alphas).sum(0)
    return -10 * float(torch.cat(errors).mean().log10()), float(lost / whole)
