"""Frames of a scene for display: colours, normals, depth, material; and the point at a pixel."""

from dataclasses import replace
from typing import get_args

import numpy as np
import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.image import to_pillow
from texgs.core.light import HEADLIGHT
from texgs.core.memory import require_memory
from texgs.fields.field import Composed, Look
from texgs.raster import Render
from texgs.raster.shading import MATERIAL
from texgs.scene.cut_view import cut_view
from texgs.scene.scene import Scene
from texgs.scene.shot import Mode
from texgs.scene.twin import LIT, Twin

BLACK_MODES = ("alpha", *MATERIAL)
SHININESS = 100.0  # displayed as white
# Of memory for a pixel: the images of the rasterizer, over a background, clamped and rounded.
BYTES_PER_PIXEL = 64
FAINT_ALPHA = 0.1  # alpha below which a pixel counts as background
HOLLOW_MODES = {"normal", "depth", *get_args(Look)} - {"shaded"}  # modes without faces of cuts


def frame(
    composed: Composed,
    camera: Camera,
    scene: Scene,
    mode: Mode = "shaded",
    twin: Twin | None = None,
    *,
    transparent: bool = False,
) -> np.ndarray:
    """Render one frame [H, W, 3], uint8, or [H, W, 4] with straight alpha for a transparent background.

    The volume is that of the scene, with its edits and the functions that it tries, under the same light.
    Normals (world) are (n + 1) / 2, depth is black at the nearest and light grey at the farthest point in the
    frame, both over the background; alpha is white where opaque; texels are around grey; discs are surfels of
    one standard deviation, as if opaque; factors of the material are grey over black, shininess divided by
    100.

    Args:
        composed: the scene's models.
        camera: from where; moved to their device.
        scene: whose edits, light, background and cuts count.
        mode: what to show.
        twin: of the scene's volume, which the mode volume and faces of cuts show; see `twin_of`.
        transparent: whether to leave the background out.

    Raises:
        ArgumentError: if the mode is unknown, or shows a volume and there is no twin.
        OutOfMemoryError: if the frame needs more memory than there is.
    """
    if mode not in get_args(Mode):
        raise ArgumentError(f"mode: expected one of {', '.join(get_args(Mode))}, got {mode}")
    what = f"a frame of {camera.width} x {camera.height} pixels"
    require_memory(BYTES_PER_PIXEL * camera.width * camera.height, what, "choose a smaller one")
    camera = camera.to(composed.device)
    if mode == "volume":
        if twin is None:
            raise ArgumentError("mode: expected a twin to show the volume, got none")
        render = twin.render(camera, scene, composed.palettes, functions=scene.functions)
    else:
        look: Look = mode if mode in get_args(Look) else "shaded"  # type: ignore[assignment]
        outputs = {"normal": ("normal",), "depth": ("depth",)}.get(mode, ())
        background = None if mode in MATERIAL else torch.tensor(scene.background, device=composed.device)
        shown = scene if mode in LIT else replace(scene, light=HEADLIGHT)  # shadows would need the volume
        render = cut_view(composed, camera, shown, twin, look=look, background=background, outputs=outputs)
    behind = render.color.new_tensor((0.0,) * 3 if mode in BLACK_MODES else scene.background)
    colors = pixels(render, mode, behind)
    if not transparent:
        return quantize(colors)
    return np.asarray(to_pillow(colors - (1 - render.alpha[..., None]) * behind, render.alpha))


def quantize(colors: Tensor) -> np.ndarray:
    """Convert colours [H, W, 3] to uint8, clamped to [0, 1]."""
    return colors.clamp(0, 1).mul_(255).round_().to(torch.uint8).cpu().numpy()


def pixels(render: Render, mode: Mode, background: Tensor) -> Tensor:
    """Return the colours [H, W, 3] of a mode."""
    alpha = render.alpha[..., None]
    if mode == "alpha":
        return alpha.expand(-1, -1, 3)
    if mode == "shininess":
        return render.color / SHININESS
    if mode == "normal":
        return 0.5 * (render.normal + alpha) + (1 - alpha) * background  # type: ignore[operator]
    if mode == "depth":
        return 0.9 * relative_depth(render)[..., None] * alpha + (1 - alpha) * background
    return render.color


def relative_depth(render: Render) -> Tensor:
    """Return the mean depth [H, W], 0 at the nearest and 1 at the farthest point that is not faint."""
    depth = render.depth
    solid = min(0.5, 0.5 * float(render.alpha.max()))  # in an entirely translucent image, its denser half
    seen = depth[render.alpha > solid]  # type: ignore[index]
    if not len(seen):
        return torch.zeros_like(render.alpha)
    low, high = seen.min(), seen.max()
    return ((depth - low) / (high - low).clamp_min(1e-6)).clamp(0, 1)  # type: ignore[operator]


def point_at(
    composed: Composed, camera: Camera, scene: Scene, mode: str, twin: Twin | None, pixel: tuple[int, int]
) -> list[float] | None:
    """Return the point [3] of the world that a pixel (column, row) shows; None for the background.

    With a twin, and in modes that can show it, it lies where half of the light is gone in the volume, or if
    it never is, at the mean depth of the volume; otherwise at the mean depth of the models.
    """
    column, row = pixel
    alone = camera.crop(column, row, column + 1, row + 1).to(composed.device)
    if twin is None or mode in HOLLOW_MODES:
        seen = cut_view(composed, alone, scene, None, outputs=("depth",))
    else:
        functions = scene.functions if mode == "volume" else None
        seen = twin.render(alone, scene, composed.palettes, functions=functions, outputs=("depth", "median"))
    if seen.depth is None or float(seen.alpha) < FAINT_ALPHA:
        return None
    depth = seen.depth if seen.median is None else torch.where(seen.median > 0, seen.median, seen.depth)
    return alone.unproject(depth.to(alone.viewmat))[0, 0].tolist()
