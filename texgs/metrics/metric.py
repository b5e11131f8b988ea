"""What a metric of edits is, and the metrics that there are: the modules of texgs/metrics/edits.

A metric is one file there. The stage edit_metrics runs all of them; the tables of edits and of sweeps take
their columns from the specifications.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from texgs.core.specifications import specifications

if TYPE_CHECKING:
    from torch import Tensor

    from texgs.core.camera import Camera
    from texgs.fields.field import Composed
    from texgs.scene.scene import Scene


@dataclass(frozen=True)
class Measure:
    """One number of a metric and its column in tables."""

    name: str  # its key in metrics.json
    title: str  # heading of its column, with the unit where it has one
    digits: int | None = None  # how many stand after the point; None for what is no number
    better: Literal["", "up", "down"] = ""  # which way is better
    published: str = ""  # column of the paper's tables of edits
    words: Mapping[Any, str] | None = None  # what tables say in place of its values


@dataclass(frozen=True)
class Metric:
    """One metric of edited scenes. Its module imports nothing heavy before `run` is called."""

    name: str
    measures: tuple[Measure, ...]
    run: Callable[[MeasuredScene], Mapping[str, Any]]  # values of measures and notes, those that there are
    notes: Mapping[str, str] | None = None  # words beside numbers, and the sentences that hold them
    order: int = 100  # where its columns stand; the lowest come first
    is_in_paper: bool = True  # whether tables that are as in the paper have its columns, too


@dataclass(frozen=True, eq=False)
class StyledModel:
    """A model of a scene and the style that it was given."""

    model: str
    part: str  # its name in titles
    image: Tensor  # [3, h, w] in [0, 1], its longer side that of the views
    region: Tensor  # [h, w] bool


@dataclass(frozen=True, eq=False)
class MeasuredScene:
    """An edited scene, and what its metrics may look at."""

    title: str  # of progress bars
    scenes: tuple[Scene, Scene]  # before and after the edit
    compositions: tuple[Composed, Composed]  # the same, opened
    geometry_file: Path  # scene whose depth says where surfaces are
    cameras: Sequence[Camera]  # along the test path
    some: Sequence[Camera]  # spread over it
    captions: tuple[str, str]  # before and after
    clip: str  # backbone of CLIP
    weights: Mapping[str, str | None]  # digests by name; None for those that nothing can work with here
    styles: Sequence[StyledModel]  # of models that follow a picture; none where parts of models do
    has_normals: bool  # whether fields of this kind render normals

    @property
    def after(self) -> Scene:
        """Return the edited scene."""
        return self.scenes[1]

    @property
    def shown(self) -> Composed:
        """Return the edited scene, opened."""
        return self.compositions[1]


def metrics() -> dict[str, Metric]:
    """Return all metrics of edits by name, in the order of their columns."""
    defined = specifications("texgs.metrics.edits", "METRIC")
    return dict(sorted(defined.items(), key=lambda item: (item[1].order, item[0])))


def values_of(scene: MeasuredScene) -> dict[str, Any]:
    """Measure all that can be measured of an edited scene."""
    return {name: value for metric in metrics().values() for name, value in metric.run(scene).items()}
