"""Views of a cut scene: faces of its volume, and the remaining parts of its models."""

from collections.abc import Collection
from dataclasses import replace
from functools import partial
from math import ceil

import torch
from torch import Tensor
from torch.nn.functional import interpolate, max_pool2d

from texgs.core.camera import Camera
from texgs.fields.field import Composed, Look
from texgs.raster import Render
from texgs.raster.api import CutRange
from texgs.scene.exposure import exposed
from texgs.scene.scene import Scene
from texgs.scene.twin import LIT, Twin, range_of
from texgs.volume.images import smaller

SLAB_UNITS = 36.0  # thickness of the slab behind a face, opacity units; it hides most of the rest
FACE_UNITS, FACE_ALPHA = 3.0, 0.05  # a face has this alpha within so many opacity units behind a cut
RIM = 0.01  # width of the slab's rim around a face, in shorter sides of the picture
HIDDEN_ALPHA = 0.998  # alpha of a slab that hides models, half a level of 255 from opaque
STEP = 0.5  # voxels between the samples of a slab
COARSE_PIXELS = 4  # step of the search for faces, pixels
Crop = tuple[slice, slice]  # rows and columns of a picture


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

    Where there are cuts, a scene shows its twin, which is exact, if that can show all of its edits. With
    looks, edited segments or several materials it shows a slab of the volume behind each face, over what the
    cuts leave of its models. Without a twin, and where more is asked for than shaded colours, cuts leave
    models without faces.

    Args:
        composed: the scene's models.
        camera: from where; on their device.
        scene: whose edits, light, background and cuts count.
        twin: of the scene's volume.
        look: see `Composed`.
        background: [3] behind models; white by default, for a factor black; behind a twin the scene's.
        outputs: besides colour and alpha.
    """
    cut = range_of(scene.cuts, camera) if scene.cuts else None
    if cut is None or twin is None or look != "shaded" or outputs:
        shown = exposed(composed, scene, twin) if look in LIT else composed
        return shown.render(
            *(camera, scene.light, scene.edits),
            look=look,
            background=background,
            outputs=outputs,
            depth_range=None if cut is None else cut.depth_range,
        )
    if scene.is_as_volume:
        return twin.render(camera, scene, composed.palettes, cut)
    return slab_view(composed, camera, scene, twin, cut)


def slab_view(composed: Composed, camera: Camera, scene: Scene, twin: Twin, cut: CutRange) -> Render:
    """Render a slab of the volume behind each face of a cut, over the models beyond it."""
    thickness, part = slab_thickness(composed, camera, scene, twin)
    rows, columns = part
    inner = camera.crop(columns.start, rows.start, columns.stop, rows.stop)
    slab = slab_of(CutRange(cut.depth_range[:, rows, columns], cut.face[part], cut.normals), thickness)
    seen = twin.with_step(STEP).cast(inner, scene, composed.palettes, slab).rgba
    beyond = cut.depth_range.clone()
    near, far = beyond[:, rows, columns]
    near.copy_(slab.depth_range[1])
    far.copy_(torch.where(seen[..., 3] < HIDDEN_ALPHA, far, near))
    models = exposed(composed, scene, twin).render(
        *(camera, scene.light, scene.edits),
        background=camera.viewmat.new_tensor(scene.background),
        depth_range=beyond,
    )
    return blend_over(seen, models, part)


def blend_over(front: Tensor, behind: Render, part: Crop) -> Render:
    """Blend premultiplied RGBA [h, w, 4] over a part of a render in place, and return the render."""
    clear = 1 - front[..., 3]
    for seen, plane in zip(front.unbind(-1), (*behind.color.unbind(-1), behind.alpha), strict=True):
        back = plane[part]
        torch.addcmul(seen, clear, back, out=back)  # by channels, which is faster than all at once
    return behind


def slab_thickness(composed: Composed, camera: Camera, scene: Scene, twin: Twin) -> tuple[Tensor, Crop]:
    """Return the thickness [h, w] of the slab in camera z, and the part of the picture that it covers.

    It falls to 0 softly around faces.
    """
    size = camera.height, camera.width
    multiple = camera.crop(
        0, 0, *(-(-size // COARSE_PIXELS) * COARSE_PIXELS for size in (camera.width, camera.height))
    )
    small = smaller(multiple, COARSE_PIXELS)
    alpha = face_alpha(composed, small, scene, twin.with_step(1.0), range_of(scene.cuts, small))
    face = grow_softly((alpha / FACE_ALPHA).clamp(max=1), ceil(RIM * min(small.height, small.width)))
    part = bounding_part(face)
    thickness = (face * (SLAB_UNITS * twin.opacity_unit) / small.ray_lengths())[part]
    thickness = interpolate(thickness[None, None], scale_factor=COARSE_PIXELS, mode="bilinear")[0, 0]
    rows, columns = (
        slice(COARSE_PIXELS * each.start, min(COARSE_PIXELS * each.stop, end))
        for each, end in zip(part, size, strict=True)
    )
    return thickness[: rows.stop - rows.start, : columns.stop - columns.start], (rows, columns)


def bounding_part(weights: Tensor) -> Crop:
    """Return the bounding box of nonzero weights [H, W], at least one pixel, with a margin of one."""
    places = [weights.any(dim).nonzero()[:, 0].tolist() or [0] for dim in (1, 0)]
    rows, columns = (slice(max(0, each[0] - 1), each[-1] + 2) for each in places)
    return rows, columns


def face_alpha(composed: Composed, camera: Camera, scene: Scene, twin: Twin, cut: CutRange) -> Tensor:
    """Return the alpha [H, W] of the volume close behind a plane; a face needs `FACE_ALPHA`."""
    soon = slab_of(cut, FACE_UNITS * twin.opacity_unit / camera.ray_lengths())
    return twin.cast(camera, scene, composed.palettes, soon).rgba[..., 3]


def grow_softly(weights: Tensor, pixels: int) -> Tensor:
    """Dilate weights [H, W] by some pixels each way, then fall to 0 over as many more."""
    reached = max_pool2d(weights[None], 2 * pixels + 1, 1, pixels)
    grown = reached
    for softer in range(pixels, 0, -1):
        reached = max_pool2d(reached, 3, 1, 1)
        grown = torch.maximum(grown, reached * (softer / (pixels + 1)))
    return grown[0]


def slab_of(cut: CutRange, thickness: Tensor) -> CutRange:
    """Return the depth ranges of rays within a thickness [H, W] behind a face, camera z; empty elsewhere."""
    near, far = cut.depth_range
    behind = torch.where(cut.face >= 0, torch.minimum(near + thickness, far), near)
    return cut._replace(depth_range=torch.stack([near, behind]))


def scene_and_volume(composed: Composed, camera: Camera, scene: Scene, twin: Twin) -> tuple[Render, Render]:
    """Render a view of a scene, and the same view of its volume."""
    camera = camera.to(composed.device)
    background = camera.viewmat.new_tensor(scene.background)
    seen = cut_view(composed, camera, scene, twin, background=background)
    return seen, twin.render(camera, scene, composed.palettes)


def scene_and_fitted(
    composed: Composed, fitted: Composed, camera: Camera, scene: Scene, outputs: Collection[str]
) -> tuple[Render, Render]:
    """Render a view of a scene, and the same view of its fitted models.

    In neither have cuts faces, nor does matter hide light: differences are those of the models.
    """
    scene = replace(scene, light=scene.light.unhidden)
    camera = camera.to(composed.device)
    background = camera.viewmat.new_tensor(scene.background)
    view = partial(cut_view, camera=camera, twin=None, background=background, outputs=outputs)
    return view(composed, scene=scene), view(fitted, scene=scene.as_fitted)
