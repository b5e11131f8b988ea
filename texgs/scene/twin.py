"""The twin of a scene: the volume it was fitted to, under the scene's light and with its edits."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np
import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.cuts import Cuts
from texgs.core.errors import ArgumentError, errors_at
from texgs.fields.part_edit import PartEdit
from texgs.raster import Render
from texgs.raster.api import CutRange, cut_range
from texgs.raster.shading import MATERIAL
from texgs.scene.cut_slices import with_slices
from texgs.scene.scene import Scene, volume_of
from texgs.volume.caster import Cast, Caster
from texgs.volume.label_masks import INSIDE, shows_label
from texgs.volume.light_cells import LightCells
from texgs.volume.matter import Matter
from texgs.volume.overlay import overlays
from texgs.volume.slices import Labels, window_of
from texgs.volume.transfer import TransferFunction

T = TypeVar("T")
LIT = ("shaded", "discs")  # modes that show light


class Twin:
    """Casts the volume of a scene in the same way as the views for its models.

    Args:
        scene: names its volume; of any edits.
        device: that casts rays.

    Raises:
        ArgumentError: if the scene names no volume, the volume cannot be read, or its basic TFs are not
            those of the scene's models.
    """

    def __init__(self, scene: Scene, device: torch.device | str = "cpu") -> None:
        self._volume, self._device, self._by_cell = volume_of(scene), torch.device(device), True
        with errors_at("volume"):
            self.grid = self._volume.open()
            self._caster = Caster(self.grid, self._volume.appearance, device)
        self._matter = deque[tuple[object, Matter]](maxlen=1)  # the latest, of all copies
        self._cells = deque[tuple[object, LightCells]](maxlen=1)
        self.places = deque[tuple[object, Tensor]](maxlen=1)  # see `texgs.scene.exposure`
        self.sky = deque[tuple[object, Tensor]](maxlen=1)
        self.exposures = deque[tuple[object, Tensor]](maxlen=1)
        for name in scene.models:
            self._tf(name)

    def with_step(self, step: float, *, by_cell: bool = True) -> Twin:
        """Return a twin with another sample distance, in voxels; for `by_cell` see `Caster.cast`."""
        other = copy(self)
        other._by_cell = by_cell
        other._volume = replace(self._volume, appearance=replace(self._volume.appearance, step=step))
        return other

    @property
    def opacity_unit(self) -> float:
        """The length over which a basic TF's opacity counts, world units."""
        return self._volume.appearance.opacity_unit

    def render(
        self,
        camera: Camera,
        scene: Scene,
        palettes: Sequence[tuple[float, ...]],
        cut: CutRange | None = None,
        functions: Mapping[str, TransferFunction] | None = None,
        outputs: Collection[str] = (),
    ) -> Render:
        """Render the volume with the edits of a scene's visible models, on the device that casts.

        A volume has no segments and no looks; see `cast` for what edits do to it.

        Args:
            camera: from where.
            scene: of this volume, with any edits.
            palettes: of its models, as fitted: `Composed.palettes`.
            cut: what of the rays counts; by default what the scene's cuts leave, with their faces.
            functions: that take the place of the basic TFs of their names, or join them; they may overlap.
            outputs: `depth` and `median`, besides colour and alpha.
        """
        seen = self.cast(camera, scene, palettes, cut, functions, outputs)
        color, alpha = seen.rgba.split([3, 1], dim=-1)
        behind = color.new_tensor(scene.background)
        return Render(color + (1 - alpha) * behind, alpha[..., 0], seen.depth, seen.median)

    def cast(
        self,
        camera: Camera,
        scene: Scene,
        palettes: Sequence[tuple[float, ...]],
        cut: CutRange | None = None,
        functions: Mapping[str, TransferFunction] | None = None,
        outputs: Collection[str] = (),
    ) -> Cast:
        """Cast the same without a background, with premultiplied colours.

        A palette moves all colours of a basic TF by the same difference, as it does those of a model; factors
        and tint of light hold for the whole volume: those of the first visible model. A tint costs a cast for
        each different channel.
        """
        shown = self._shown(scene, palettes, functions or {})
        edit = next((model.edit for model in scene.models.values() if is_seen(model.edit)), PartEdit())
        look = self._volume.appearance
        look = replace(look, **{key: getattr(look, key) * getattr(edit, key) for key in MATERIAL})
        cut = range_of(scene.cuts, camera) if cut is None and scene.cuts else cut
        casts = {}
        for share in dict.fromkeys(edit.tint) if shown else ():  # the only difference between channels
            caster = self._caster.with_appearance(replace(look, specular=share * look.specular))
            casts[share] = caster.cast(
                *(overlays(shown), camera, scene.light, outputs),
                depth_range=None if cut is None else cut.depth_range,
                faces=cut,
                lit_faces=scene.cuts.faces == "shaded",
                by_cell=self._by_cell,
                cells=self._lit(scene, shown) if scene.light.casts_shadows else None,
            )
        clear = torch.zeros(camera.height, camera.width, 4, device=self._device)
        seen = casts.get(edit.tint[0]) or Cast(clear, **{name: clear[..., 0].clone() for name in outputs})
        for channel, share in enumerate(edit.tint[1:], start=1):
            if share != edit.tint[0]:
                seen.rgba[..., channel] = casts[share].rgba[..., channel]
        if cut is None or scene.cuts.faces != "slice":
            return seen
        window = scene.cuts.window or window_of(self.grid)
        return with_slices(seen, camera, cut, self._caster, window, self.labels(scene, palettes))

    def labels(self, scene: Scene, palettes: Sequence[tuple[float, ...]]) -> Labels:
        """Return the labels of the volume by the names of their models, in the colours that they have now."""
        shown, labels = self._shown(scene, palettes, {}), self._volume.tfs.items()
        colors = {name: tf(INSIDE)[:3] for name, tf in shown.items()}
        return {name: (tf.channel, colors.get(name)) for name, tf in labels if shows_label(tf)}

    def light_cells(self, scene: Scene, palettes: Sequence[tuple[float, ...]]) -> LightCells:
        """Return which shares of a scene's light reach places in its volume; kept while both are the same."""
        return self._lit(scene, self._shown(scene, palettes, {}))

    def matter(self, scene: Scene, palettes: Sequence[tuple[float, ...]]) -> Matter:
        """Return what hides light in a scene's volume: its functions with their edits, where no cut is."""
        return self._hiding(scene, self._shown(scene, palettes, {}))

    def _lit(self, scene: Scene, shown: Mapping[str, TransferFunction]) -> LightCells:
        light, matter = scene.light, self._hiding(scene, shown)
        reach = light.reach if light.occlusion else None
        state = matter, light.kind, light.azimuth, light.polar, light.shadows > 0, reach
        return last_of(self._cells, state, lambda: matter.under(light))

    def _hiding(self, scene: Scene, shown: Mapping[str, TransferFunction]) -> Matter:
        tfs, unit = overlays(shown), self.opacity_unit
        state = tfs, unit, scene.cuts
        return last_of(self._matter, state, lambda: Matter(self._caster, tfs, unit, scene.cuts))

    def _shown(
        self, scene: Scene, palettes: Sequence[tuple[float, ...]], functions: Mapping[str, TransferFunction]
    ) -> dict[str, TransferFunction]:
        """Return the functions that a scene shows, with the edits of its models; or others in their place."""
        shown = {}
        for (name, model), palette in zip(scene.models.items(), palettes, strict=True):
            if is_seen(model.edit):
                shown[name] = edit_function(functions.get(name) or self._tf(name), model.edit, palette)
        return shown | {name: tf for name, tf in functions.items() if name not in scene.models}

    def _tf(self, name: str) -> TransferFunction:
        """Return the basic TF of a model."""
        if name not in self._volume.tfs:
            known = ", ".join(self._volume.tfs) or "none"
            raise ArgumentError(f"volume.tfs: expected the basic TF of model {name}, got {known}; add it")
        return self._volume.tfs[name]


def is_seen(edit: PartEdit) -> bool:
    """Return whether an edit leaves anything of a model."""
    return edit.visible and edit.opacity > 0


def last_of(kept: deque[tuple[object, T]], state: object, make: Callable[[], T]) -> T:
    """Return the cached result of a state, or compute it and replace the oldest one."""
    for each, value in tuple(kept):  # another thread may change it
        if each == state:
            return value
    value = make()
    kept.append((state, value))
    return value


def twin_of(scene: Scene, device: torch.device | str = "cpu") -> Twin | None:
    """Return the twin that shaded frames need for faces of cuts and for shadows, or None without both."""
    return Twin(scene, device) if needs_twin(scene, "shaded") else None


def needs_twin(scene: Scene, mode: str) -> bool:
    """Return whether frames of a mode need the scene's volume: they show it, or shadows."""
    shows_shadows = mode in LIT and scene.light.casts_shadows
    return mode == "volume" or (scene.volume is not None and (bool(scene.cuts) or shows_shadows))


def range_of(cuts: Cuts, camera: Camera) -> CutRange:
    """Return the parts of a camera's rays inside of cuts, and the faces at which rays begin."""
    planes = [[*plane.normal, plane.offset] for plane in cuts.half_spaces]
    normals, offsets = camera.viewmat.new_tensor(planes).split([3, 1], dim=1)
    return cut_range(normals, offsets[:, 0], camera)


@lru_cache(maxsize=32)  # frames of a moving camera repeat it
def edit_function(tf: TransferFunction, edit: PartEdit, palette: tuple[float, ...]) -> TransferFunction:
    """Apply an edit's colour and opacity to a basic TF, clamped to [0, 1] at every value."""
    opacity = clip_points([(value, alpha * edit.opacity) for value, alpha in tf.opacity])
    if edit.palette is None:
        return tf.with_points(opacity, tf.color)
    moved = np.subtract(edit.palette, palette)
    return tf.with_points(opacity, clip_points([(value, *np.add(rgb, moved)) for value, *rgb in tf.color]))


def clip_points(points: Sequence[tuple[float, ...]]) -> Any:
    """Clamp a piecewise linear function to [0, 1], adding points where clamping begins."""
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
