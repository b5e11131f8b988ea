"""The volume with all basic TFs, edited as a scene is: what its pictures are compared with."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from texgs.cli.stages.settings import OfScene
from texgs.cli.stages.tf import in_data_values
from texgs.cli.stages.views import appearance_of, mapper_for
from texgs.core.camera import Camera
from texgs.core.io import read_json
from texgs.core.light import Light
from texgs.fields.part_edit import PartEdit
from texgs.volume.appearance import Appearance
from texgs.volume.basic_tfs import combine
from texgs.volume.nrrd_file import open_grid
from texgs.volume.render import Mapper
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
        self.kind = settings.views.mapper
        self._mappers: dict[Appearance, Mapper] = {}

    def render(
        self,
        camera: Camera,
        light: Light,
        edits: Sequence[PartEdit] | None = None,
        palettes: Sequence[Sequence[float]] = (),
    ) -> np.ndarray:
        """Premultiplied RGBA [H, W, 4] of all visible basic TFs with edits.

        A palette moves all colours of a basic TF by the same difference, as it does those of a model; factors
        of light hold for the whole volume: those of the first visible model.

        Args:
            camera: from where.
            light: shines on it.
            edits: one for each basic TF; by default nothing is changed.
            palettes: as fitted, of each model; needed where an edit changes one.
        """
        edits = [PartEdit()] * len(self.tfs) if edits is None else edits
        shown = {}
        for index, (name, edit) in enumerate(zip(self.tfs, edits, strict=True)):
            if edit.visible and edit.opacity > 0:
                shown[name] = edited(self.tfs[name], edit, palettes[index] if edit.palette else ())
        if not shown:
            return np.zeros((camera.height, camera.width, 4), dtype=np.float32)
        first = next(edit for edit in edits if edit.visible and edit.opacity > 0)
        names = ("ambient", "diffuse", "specular", "shininess")
        factors = {name: getattr(self.look, name) * getattr(first, name) for name in names}
        look = replace(self.look, **factors)
        if look not in self._mappers:
            self._mappers[look] = mapper_for(self.kind, self.grid, look)
        return self._mappers[look].render(combine(shown), camera, light)


def edited(tf: TransferFunction, edit: PartEdit, palette: Sequence[float]) -> TransferFunction:
    """A basic TF with an edit's colour and opacity."""
    opacity = tuple((value, min(1.0, alpha * edit.opacity)) for value, alpha in tf.opacity)
    color = tf.color
    if edit.palette is not None:
        moved = np.subtract(edit.palette, palette)
        color = tuple((point[0], *np.clip(np.add(point[1:], moved), 0, 1).tolist()) for point in tf.color)
    return TransferFunction(opacity, color)
