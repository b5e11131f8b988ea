"""The volume with all basic TFs, edited as a scene is: what its pictures are compared with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texgs.workflow.stages.settings import OfScene, basic_tfs_of
from texgs.workflow.stages.views import appearance_of, renderer_for

if TYPE_CHECKING:
    import numpy as np

    from texgs.core.camera import Camera
    from texgs.fields.part_edit import PartEdit
    from texgs.scene.scene import Scene
    from texgs.volume.transfer import TransferFunction


class VolumeScene:
    """A volume and its basic TFs.

    Args:
        settings: of a job that compares with it.
        volume: volume.nrrd, with volume.json beside it.
    """

    def __init__(self, settings: OfScene, volume: Path) -> None:
        from texgs.volume.nrrd_file import open_grid

        self.tfs = basic_tfs_of(volume, settings.basic_tfs, settings.tf_values)
        self.grid = open_grid(volume)
        self.look = appearance_of(settings.views)
        self._renderer = renderer_for(settings.views.renderer, self.grid, self.look)

    def render(self, camera: Camera, scene: Scene, palettes: Sequence[tuple[float, ...]]) -> np.ndarray:
        """Return premultiplied RGBA [H, W, 4] of the basic TFs of a scene's visible models, with their edits.

        A palette moves all colours of a basic TF by the same difference, as it does those of a model; factors
        of light hold for the whole volume: those of the first visible model.

        Args:
            camera: from where.
            scene: whose models have the names of basic TFs; its light shines.
            palettes: of its models, as fitted.
        """
        import numpy as np

        from texgs.raster.shading import MATERIAL
        from texgs.volume.transfer import combine

        edits = [(name, model.edit) for name, model in scene.models.items()]
        shown, factors = {}, list[dict[str, float]]()
        for (name, edit), palette in zip(edits, palettes, strict=True):
            if edit.visible and edit.opacity > 0:
                shown[name] = edited(self.tfs[name], edit, palette)
                factors.append({key: getattr(self.look, key) * getattr(edit, key) for key in MATERIAL})
        if not shown:
            return np.zeros((camera.height, camera.width, 4), dtype=np.float32)
        self._renderer = self._renderer.with_appearance(replace(self.look, **factors[0]))
        return self._renderer.render(combine(shown), camera, scene.light)

    def over_background(
        self, camera: Camera, scene: Scene, palettes: Sequence[tuple[float, ...]]
    ) -> np.ndarray:
        """Return the same over the scene's background, [H, W, 3]."""
        import numpy as np

        rgba = self.render(camera, scene, palettes)
        return rgba[..., :3] + (1 - rgba[..., 3:]) * np.asarray(scene.background, dtype="float32")


def edited(tf: TransferFunction, edit: PartEdit, palette: Sequence[float]) -> TransferFunction:
    """Return a basic TF with an edit's colour and opacity, cut off at 0 and 1 at every value."""
    import numpy as np

    from texgs.volume.transfer import TransferFunction

    opacity = clipped([(value, alpha * edit.opacity) for value, alpha in tf.opacity])
    if edit.palette is None:
        return TransferFunction(opacity, tf.color)
    moved = np.subtract(edit.palette, palette)
    return TransferFunction(opacity, clipped([(value, *np.add(rgb, moved)) for value, *rgb in tf.color]))


def clipped(points: Sequence[tuple[float, ...]]) -> Any:
    """Return the points of a piecewise linear function cut off at 0 and 1, with those where that begins."""
    import numpy as np

    made = [points[0]]
    for before, after in pairwise(points):
        places = {
            (bound - one) / (other - one)
            for one, other in zip(before[1:], after[1:], strict=True)
            for bound in (0, 1)
            if min(one, other) < bound < max(one, other) and before[0] < after[0]
        }
        for t in sorted(places):
            made.append(tuple((1 - t) * one + t * other for one, other in zip(before, after, strict=True)))
        made.append(after)
    return tuple((value, *np.clip(channels, 0, 1).tolist()) for value, *channels in made)
