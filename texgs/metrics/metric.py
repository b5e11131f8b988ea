"""Specifications of metrics of edits, from the modules of texgs/metrics/edits.

A metric is one file there. It measures the scene, or watches its views: then VGG-16 runs once a view for all
metrics. The stage edit_metrics runs all of them; the tables of edits and of sweeps take their columns from
the specifications.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol, runtime_checkable

from texgs.core.errors import ArgumentError, ConfigError
from texgs.core.names import is_number
from texgs.core.specifications import require_call, specifications

if TYPE_CHECKING:
    from torch import Tensor

    from texgs.core.camera import Camera
    from texgs.fields.field import Composed
    from texgs.models.vgg import Vgg
    from texgs.raster import Render
    from texgs.scene.scene import Scene

LAST_FRAMES = 32  # frames to keep, enough for a usual number of views


@dataclass(frozen=True)
class Measure:
    """One number of a metric and its column in tables."""

    name: str  # its key in metrics.json
    title: str  # heading of its column, with the unit, if any
    digits: int | None = None  # digits after the point; None for words
    better: Literal["", "up", "down"] = ""  # which way is better
    published: str = ""  # column of the paper's tables of edits
    words: Mapping[Any, str] | None = None  # words in tables for its values

    def __post_init__(self) -> None:
        if self.better not in ("", "up", "down"):
            raise ConfigError(f"measure {self.name}: better: expected up, down or '', got {self.better!r}")
        if not isinstance(self.digits, int | None):
            raise ConfigError(f"measure {self.name}: digits: expected a whole number, got {self.digits!r}")


@dataclass(frozen=True)
class Metric:
    """One metric of edited scenes. Its module must import nothing heavy before `run`."""

    name: str
    measures: tuple[Measure, ...]
    run: Callable[[MeasuredScene], Mapping[str, Any] | Watcher]  # values of measures and notes
    notes: Mapping[str, str] | None = None  # sentences for notes beside numbers, by key
    order: int = 100  # position of its columns, in rising order
    is_in_paper: bool = True  # whether the paper's tables include its columns
    tables: tuple[str, ...] = ()  # names of values that are tables of numbers, not shown
    # Maps the pictures and values of all looks of a scene to further measures of each look.
    among: Callable[[Sequence[tuple[str, Mapping[str, Any]]]], Sequence[Mapping[str, Any]]] | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.measures, tuple):
            got = type(self.measures).__name__
            raise ConfigError(f"metric {self.name}: measures: expected a tuple, (Measure(...),), got {got}")
        require_call(f"metric {self.name}", self.run, "measured")

    @property
    def names(self) -> list[str]:
        """Return the names of all its values."""
        return [*(measure.name for measure in self.measures), *(self.notes or ()), *self.tables]


@dataclass(frozen=True, eq=False)
class SeenView:
    """A view of the edited scene with its features of VGG-16."""

    place: int  # index along the path
    image: Tensor  # [H, W, 3] in [0, 1]
    alpha: Tensor  # [H, W]
    layers: Mapping[str, Tensor]  # [1, C, h, w] layers of LPIPS and styles by name; none without weights


@runtime_checkable
class Watcher(Protocol):
    """Measures one view after another, so that VGG-16 runs once a view for all metrics."""

    def see(self, view: SeenView) -> None:
        """Measure a view."""

    def values(self) -> Mapping[str, Any]:
        """Return the values of measures and notes after the last view."""


@dataclass(frozen=True, eq=False)
class Style:
    """A picture that a scene or one of its models follows."""

    model: str | None  # to measure alone; None: the whole scene
    image: Tensor  # [3, h, w] in [0, 1], its longer side that of the views
    region: Tensor  # [h, w] bool


@dataclass(frozen=True, eq=False)
class MeasuredScene:
    """An edited scene with the inputs of its metrics."""

    title: str  # of progress bars
    scenes: tuple[Scene, Scene]  # before and after the edit
    compositions: tuple[Composed, Composed]  # the same, opened
    geometry_file: Path  # scene whose depth defines the surfaces
    cameras: Sequence[Camera]  # along the test path
    compared: int  # number of cameras to measure with
    captions: tuple[str, str]  # before and after
    clip: str  # backbone of CLIP
    weights: Mapping[str, str | None]  # digests by name; None for unusable weights
    styles: Sequence[Style]  # empty if parts of models follow pictures

    @property
    def after(self) -> Scene:
        """Return the edited scene."""
        return self.scenes[1]

    @property
    def shown(self) -> Composed:
        """Return the edited scene, opened."""
        return self.compositions[1]

    @property
    def places(self) -> list[int]:
        """Return the indices of measured cameras: the middles of equal parts of the path, or all."""
        length, count = len(self.cameras), min(self.compared, len(self.cameras))
        return [(2 * index + 1) * length // (2 * count) for index in range(count)]

    @property
    def some(self) -> list[Camera]:
        """Return the measured cameras."""
        return [self.cameras[place] for place in self.places]

    @cached_property
    def frame(self) -> Callable[[int], Render]:
        """Return a cached renderer of the edited scene along the path."""
        shown, scene, cameras = self.shown, self.after, self.cameras  # not self, which would keep itself
        return lru_cache(LAST_FRAMES)(lambda place: shown.render(cameras[place], scene.light, scene.edits))

    @cached_property
    def vgg(self) -> Vgg | None:
        """Return VGG-16 in single precision for all metrics, or None without weights."""
        import torch

        from texgs.models.lpips import LAYERS
        from texgs.models.vgg import STYLE_LAYERS, Vgg

        layers = sorted({*LAYERS, *STYLE_LAYERS})
        is_here = self.weights["vgg16"] is not None
        return Vgg.load(None, self.shown.device, layers, torch.float32) if is_here else None

    def views(self) -> Iterator[SeenView]:
        """Yield the measured views one at a time, because features are larger than pixels."""
        from texgs.core.progress import progress

        for place in progress(self.places, title=self.title, unit="view"):
            shown = self.frame(place)
            image, layers = shown.color.clamp(0, 1), {}
            if vgg := self.vgg:
                layers = dict(zip(vgg.wanted, vgg.layers(image.permute(2, 0, 1)[None]), strict=True))
            yield SeenView(place, image, shown.alpha, layers)


def metrics() -> dict[str, Metric]:
    """Return all metrics of edits by name, in column order; names of values are unique."""
    defined, owners = specifications("texgs.metrics.edits", "METRIC"), dict[str, str]()
    for metric in defined.values():
        for name in metric.names:
            if owners.setdefault(name, metric.name) != metric.name:
                raise ConfigError(
                    f"metrics {owners[name]} and {metric.name}: expected values of names of their own, got "
                    f"{name} of both; rename one"
                )
    return dict(sorted(defined.items(), key=lambda item: (item[1].order, item[0])))


def values_of(scene: MeasuredScene, chosen: Iterable[Metric] | None = None) -> dict[str, Any]:
    """Measure an edited scene by all metrics that apply, or by some.

    Raises:
        ArgumentError: if a metric gives a value that it does not declare.
    """
    import torch

    chosen = [*(metrics().values() if chosen is None else chosen)]
    with torch.no_grad():
        results = [metric.run(scene) for metric in chosen]
        watchers = [each for each in results if isinstance(each, Watcher)]
        for view in scene.views() if watchers else ():
            for watcher in watchers:
                watcher.see(view)
        given = [each.values() if isinstance(each, Watcher) else each for each in results]
    for metric, values in zip(chosen, given, strict=True):
        require_declared(metric, values)
    return {name: value for each in given for name, value in each.items()}


def require_declared(metric: Metric, values: Any) -> None:
    """Require the values that a metric declares: numbers for columns with digits, or None."""
    where = f"metric {metric.name}"
    if not isinstance(values, Mapping):
        raise ArgumentError(f"{where}: expected values by their names, got {type(values).__name__}")
    if unknown := [name for name in values if name not in metric.names]:
        raise ArgumentError(
            f"{where}: expected values of {', '.join(metric.names)}, got {unknown[0]}; give it a Measure"
        )
    for name in (measure.name for measure in metric.measures if measure.digits is not None):
        value = values.get(name)
        if value is not None and not is_number(value):
            kind = f"{value}" if isinstance(value, float) else type(value).__name__
            raise ArgumentError(f"{where}: {name}: expected a finite float or int, or None, got {kind}")
