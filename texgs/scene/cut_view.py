"""What is seen of a scene that is cut: faces of its volume, and what the cut leaves of its models."""

from __future__ import annotations

from collections.abc import Collection

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.fields.field import Composed, Look
from texgs.raster import Render
from texgs.raster.cuts import CutRange
from texgs.scene.scene import Scene
from texgs.scene.twin import Twin, range_of

SLAB = 20.0  # opacity units of the volume behind a face, which hide most of what is beyond


def cut_view(
    composed: Composed,
    camera: Camera,
    scene: Scene,
    twin: Twin | None,
    *,
    look: Look = "shaded",
    background: Tensor | None = None,
    outputs: Collection[str] = (),
) -> Render:
    """Render one view of a scene with its edits, light and cuts.

    Where there are cuts, a scene without looks shows its twin, which is exact; one with looks shows a slab of
    the volume behind each face, over what the cuts leave of its models. Without a twin, and where more is
    asked for than shaded colours, cuts leave models without faces.

    Args:
        composed: the scene's models.
        camera: from where; on their device.
        scene: whose edits, light, background and cuts count.
        twin: of the scene's volume.
        look: see `Composed`.
        background: [3] behind models; white by default, for a factor black.
        outputs: besides colour and alpha.
    """
    cut = range_of(scene.cuts, camera) if scene.cuts else None
    if cut is None or twin is None or look != "shaded" or outputs:
        return composed.render(
            *(camera, scene.light, scene.edits),
            look=look,
            background=background,
            outputs=outputs,
            depth_range=None if cut is None else cut.depth_range,
        )
    if scene.has_looks:
        return slab_view(composed, camera, scene, twin, cut)
    return twin.render(camera, scene, composed.palettes, cut)


def slab_view(composed: Composed, camera: Camera, scene: Scene, twin: Twin, cut: CutRange) -> Render:
    """Render a slab of the volume behind each face of a cut, over the models beyond it."""
    before = slab_of(cut, camera, SLAB * twin.opacity_unit)
    slab = twin.render(camera, scene, composed.palettes, before)
    background = camera.viewmat.new_tensor(scene.background)
    beyond = torch.stack([before.depth_range[1], cut.depth_range[1]])
    models = composed.render(camera, scene.light, scene.edits, background=background, depth_range=beyond)
    clear = 1 - slab.alpha[..., None]
    color = slab.color + clear * (models.color - background)
    return Render(color, slab.alpha + clear[..., 0] * models.alpha)


def slab_of(cut: CutRange, camera: Camera, length: float) -> CutRange:
    """Return what of a cut's rays lies within a length behind a face, world units; of other rays nothing."""
    near, far = cut.depth_range
    thickness = length / camera.rays().norm(dim=-1)  # as camera z
    behind = torch.where(cut.face >= 0, torch.minimum(near + thickness, far), near)
    return cut._replace(depth_range=torch.stack([near, behind]))


def beside(composed: Composed, camera: Camera, scene: Scene, twin: Twin) -> tuple[Render, Render]:
    """Return a view of a scene, and the same view of its volume."""
    camera = camera.to(composed.device)
    background = camera.viewmat.new_tensor(scene.background)
    seen = cut_view(composed, camera, scene, twin, background=background)
    return seen, twin.render(camera, scene, composed.palettes)
