"""Results of jobs: stages make these, `metrics.json` holds them, tables read them.

What was not measured is None, and is left out of the file. Units are in the names. A stage may define its
result in its own module: every subclass of `Result` is known by its name once its module is imported.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Any

from texgs.core.typed import typed

NO_METHOD = "none"  # edit of a scene as it was fitted
NO_SWEEP = "none"  # sweep of a job that is no variant


class Result:
    """What a job found out; subclasses are dataclasses."""

    @classmethod
    def of(cls, numbers: Mapping[str, Any]) -> Any:
        """Return the result that `plain` made these numbers of.

        Raises:
            OmegaConfBaseException: for a key that is unknown or missing, or a value of another type.
        """
        return typed(cls, numbers)


@dataclass(frozen=True)
class VolumeResult(Result):
    """A volume, checked and in one file."""

    dims: list[int]  # samples along x, y, z
    dtype: str
    spacing: list[float]
    origin: list[float]
    minimum: float
    maximum: float
    voxels: int
    volume_mib: float


@dataclass(frozen=True)
class TransferResult(Result):
    """Basic transfer functions over a histogram."""

    basic_tfs: int
    ranges: dict[str, list[float]]  # lowest and highest value of each


@dataclass(frozen=True)
class ViewsResult(Result):
    """Views of a basic transfer function."""

    train: int  # views
    test: int
    width: int
    height: int
    coverage: float | None = None  # mean share of the pixels that show something
    frame_ms: float | None = None  # median, without the first frame
    frame_max_ms: float | None = None
    first_frame_ms: float | None = None
    frames_ms: list[float] = field(default_factory=list)


@dataclass(frozen=True)
class SheetResult(Result):
    """A contact sheet of views."""

    train: int  # views there are
    test: int
    width: int
    height: int


@dataclass(frozen=True)
class FitResult(Result):
    """A phase of a fit."""

    fit_seconds: float
    primitives: int
    iterations: int = 0
    losses: list[float] = field(default_factory=list)  # that were looked at
    psnr: float | None = None  # of test views, dB
    ssim: float | None = None
    train_psnr: float | None = None
    train_ssim: float | None = None
    train_views: int | None = None
    width: int | None = None  # of all these views as they were compared, pixels
    height: int | None = None
    peak_gpu_memory_mib: float | None = None
    sizes: dict[str, float] = field(default_factory=dict)  # of the last phase, see `Field.sizes`
    material: dict[str, float] = field(default_factory=dict)  # medians of its factors, by name
    notes: dict[str, Any] = field(default_factory=dict)  # for people


@dataclass(frozen=True)
class FigureResult(Result):
    """A figure of a fit."""

    shown: list[str]  # views
    primitives: int


@dataclass(frozen=True)
class ComparisonResult(Result):
    """Fits side by side."""

    recipes: list[str]
    shown: list[str]  # views


@dataclass(frozen=True)
class Shown:
    """One picture of a gallery."""

    grid: str
    row: str
    column: str
    psnr: float | None = None  # against the volume, where that is what it shows, dB


@dataclass(frozen=True)
class GalleryResult(Result):
    """Scenes side by side."""

    section: str  # of the report
    shown: list[Shown]


@dataclass(frozen=True)
class MeshResult(Result):
    """The surface of a fit against that of its volume; lengths in world units."""

    chamfer: float  # mean of the next two
    accuracy: float  # mean distance of the mesh from the surface
    completeness: float  # and back
    f_score: float  # of what is within the tolerance, in [0, 1]
    normal_angle: float  # degrees
    vertices: int
    triangles: int
    mesh_seconds: float
    tolerance: float
    visible: float  # share of the surface that training views see: the rest does not count


@dataclass(frozen=True)
class SceneResult(Result):
    """Fields as one scene."""

    models: int
    primitives: int


@dataclass(frozen=True)
class Comparison:
    """An edit by numbers, against the volume with the same edit."""

    title: str
    psnr: float | None = None  # means over views, dB
    ssim: float | None = None


@dataclass(frozen=True)
class PseResult(Result):
    """Edits by numbers, and a light that moves."""

    views: int
    pse: list[Comparison]
    relight: list[Comparison]


@dataclass(frozen=True)
class TimingResult(Result):
    """Frames of a scene, and of its volume in the same job."""

    frame_mean_ms: float
    frame_max_ms: float
    frame_median_ms: float
    primitives: int
    width: int
    height: int
    threads: int
    volume_mean_ms: float | None = None
    volume_max_ms: float | None = None


@dataclass(frozen=True)
class PageResult(Result):
    """A scene as a page for a browser."""

    edit: str  # or "none"
    primitives: int
    page_mib: float
    is_embedded: bool  # whether the report holds it


@dataclass(frozen=True)
class EditResult(Result):
    """A scene with a new look or a new part."""

    edit: str
    method: str
    how: str  # what the method worked with
    edit_seconds: float
    lambda_s: float | None = None
    notes: dict[str, Any] = field(default_factory=dict)  # for people
    follows: str = ""  # "style" or "instruction"
    followed: dict[str, str] = field(default_factory=dict)  # the picture or the words, by model
    iterations: int = 0  # of the method, for each part
    losses: dict[str, list[float]] = field(default_factory=dict)  # over them, by part and term


@dataclass(frozen=True)
class EditMeasures(Result):
    """What was measured of an edited scene."""

    edit: str
    method: str
    width: int | None = None  # of the frames, pixels
    height: int | None = None
    values: dict[str, Any] = field(default_factory=dict)  # of texgs/metrics/edits, by name

    @classmethod
    def of(cls, numbers: Mapping[str, Any]) -> EditMeasures:
        """Return the measures that `plain` made these numbers of; whoever has the metrics checks `values`."""
        own = {each.name for each in fields(cls)} - {"values"}
        known = {name: value for name, value in numbers.items() if name in own}
        return typed(cls, {**known, "values": {k: v for k, v in numbers.items() if k not in own}})


def plain(result: Result) -> dict[str, Any]:
    """Return what `metrics.json` holds of a result: all that was measured, values by name side by side."""
    told = asdict(result)  # type: ignore[call-overload]
    told |= told.pop("values", {})
    return {name: value for name, value in told.items() if value is not None}


def result_of(kind: str, numbers: Mapping[str, Any]) -> Any:
    """Return the result of one kind that `plain` made these numbers of.

    Raises:
        KeyError, OmegaConfBaseException: if they are those of no result.
    """
    return {each.__name__: each for each in Result.__subclasses__()}[kind].of(numbers)
