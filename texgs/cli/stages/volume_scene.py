"""The volume with all basic TFs, edited as a scene is: what its pictures are compared with."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from texgs.cli.stages.settings import OfScene
from texgs.cli.stages.tf import in_data_values
from texgs.cli.stages.views import appearance_of, mapper_for
from texgs.core.camera import Camera
from texgs.core.io import read_json
from texgs.core.light import Light
from texgs.fields.part_edit import PartEdit
from texgs.volume.basic_tfs import combine
from texgs.volume.nrrd_file import open_grid
from texgs.volume.transfer import TransferFunction


class VolumeScene:
    """A volume and its basic TFs.

    Args:
        settings: of a job that compares with it.
        volume: volume.nrrd, with volume.json beside it.
    """

    def __init__(self, settings: OfScene, volume: Path) -> None:
        summary = read_json(volume.with_name("volume.json"))
        bounds = (settings.tf_values, summary["minimum"], summary["maximum"])
        self.tfs = {
            name: in_data_values(name, points, *bounds) for name, points in settings.basic_tfs.items()
        }
        self.grid = open_grid(volume)
        self.look = appearance_of(settings.views)
        self._mapper = mapper_for(settings.views.mapper, self.grid, self.look)

    def render(
        self,
        camera: Camera,
        light: Light,
        edits: Mapping[str, PartEdit] | None = None,
        palettes: Mapping[str, Sequence[float]] | None = None,
    ) -> np.ndarray:
        """Premultiplied RGBA [H, W, 4] of all visible basic TFs with edits.

        A palette moves all colours of a basic TF by the same difference, as it does those of a model; factors
        of light hold for the whole volume: those of the first visible model.

        Args:
            camera: from where.
            light: shines on it.
            edits: by basic TF, those of the models of a scene; by default nothing is changed.
            palettes: as fitted, by model; needed where an edit changes one.
        """
        edits = dict.fromkeys(self.tfs, PartEdit()) if edits is None else edits
        visible = {name: edit for name, edit in edits.items() if edit.visible and edit.opacity > 0}
        if not visible:
            return np.zeros((camera.height, camera.width, 4), dtype=np.float32)
        shown = {
            name: edited(self.tfs[name], edit, (palettes or {})[name] if edit.palette else ())
            for name, edit in visible.items()
        }
        first, names = next(iter(visible.values())), ("ambient", "diffuse", "specular", "shininess")
        factors = {name: getattr(self.look, name) * getattr(first, name) for name in names}
        self._mapper = self._mapper.looking(replace(self.look, **factors))
        return self._mapper.render(combine(shown), camera, light)


def edited(tf: TransferFunction, edit: PartEdit, palette: Sequence[float]) -> TransferFunction:
    """A basic TF with an edit's colour and opacity, cut off at 0 and 1 at every value."""
    opacity = clipped([(value, alpha * edit.opacity) for value, alpha in tf.opacity])
    if edit.palette is None:
        return TransferFunction(opacity, tf.color)
    moved = np.subtract(edit.palette, palette)
    return TransferFunction(opacity, clipped([(value, *np.add(rgb, moved)) for value, *rgb in tf.color]))


def clipped(points: Sequence[tuple[float, ...]]) -> Any:
    """Points of a piecewise linear function that is cut off at 0 and 1, with those where that begins."""
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
