"""Metric `consistency`: agreement of views on their common part, near and far along the test path."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any

from texgs.metrics.metric import LAST_FRAMES, Measure, MeasuredScene, Metric, SeenView

if TYPE_CHECKING:
    from texgs.fields.field import Composed
    from texgs.metrics.consistency import Difference, SeenFrame
    from texgs.scene.scene import Scene


def run(measured: MeasuredScene) -> Pairs:
    """Compare views with others near and far along the path, under the scene's light.

    Fields that have light in their colours can be compared with others so. Nothing is measured where no two
    views see the same, as of a scene that is nowhere opaque.
    """
    return Pairs(measured)


class Pairs:
    """Compares views of a scene with later ones on the path, warped by the depth of its geometry."""

    def __init__(self, measured: MeasuredScene) -> None:
        from texgs.fields.files import kind_of
        from texgs.models.lpips import Lpips
        from texgs.scene.scene_file import read_scene

        self.measured = measured
        surfaces = without_hidden(read_scene(measured.geometry_file), measured.after)
        depth = kind_of(next(iter(surfaces.models.values())).file).depth or "median"
        opened = surfaces.open(measured.shown.device)
        is_here = measured.vgg and measured.weights["lpips_vgg"]
        self.lpips = Lpips.load(measured.vgg, device=measured.shown.device) if is_here else None
        self.frame = lru_cache(LAST_FRAMES)(partial(seen_frame, measured, opened, depth))
        self.pairs: dict[str, list[Difference]] = {"short": [], "long": []}

    def see(self, view: SeenView) -> None:
        """Compare a view with the views `SHORT_RANGE` and `LONG_RANGE` later on the path."""
        from texgs.metrics.consistency import LONG_RANGE, SHORT_RANGE, difference

        distance = partial(self.lpips.changed, view.layers) if self.lpips else None
        for name, apart in (("short", SHORT_RANGE), ("long", LONG_RANGE)):
            if view.place + apart < len(self.measured.cameras):
                first, second = self.frame(view.place), self.frame(view.place + apart)
                compared = difference(first, second, distance)
                self.pairs[name] += [compared] if compared else []

    def values(self) -> dict[str, Any]:
        """Return the means over pairs."""
        from texgs.metrics.consistency import mean_differences

        means = {name: mean_differences(pairs) for name, pairs in self.pairs.items() if pairs}
        rmse = {f"{name}_rmse": mean for name, (mean, _) in means.items()}
        return rmse | {f"{name}_lpips": distance for name, (_, distance) in means.items()}


def seen_frame(measured: MeasuredScene, surfaces: Composed, depth: str, place: int) -> SeenFrame:
    """Return a frame of the path with the depth of the geometry."""
    from texgs.metrics.consistency import SeenFrame

    camera, shown = measured.cameras[place], measured.frame(place)
    surface = surfaces.render(camera, outputs=(depth,))
    return SeenFrame(shown.color.clamp(0, 1), getattr(surface, depth), surface.alpha, camera)


def without_hidden(geometry: Scene, scene: Scene) -> Scene:
    """Return the geometry without hidden models, or all of it if everything is hidden."""
    hidden = {name for name, model in scene.models.items() if not model.edit.visible}
    shown = {name: model for name, model in geometry.models.items() if name not in hidden}
    return replace(geometry, models=shown or geometry.models)


METRIC = Metric(
    "consistency",
    (
        Measure("short_rmse", "RMSE, near", 4, "down"),
        Measure("long_rmse", "RMSE, far", 4, "down"),
        Measure("short_lpips", "LPIPS, near", 4, "down"),
        Measure("long_lpips", "LPIPS, far", 4, "down"),
    ),
    run,
    order=50,
)
