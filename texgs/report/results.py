"""Results of jobs: stages make them, `metrics.json` stores them, tables read them.

What was not measured is None, and is left out of the file. Units are in the names. A result that no table
reads is in the module of its stage.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Any, ClassVar, Self

from texgs.core.errors import ConfigError
from texgs.core.keys import typed
from texgs.core.names import close

SECTIONS = {  # of the report, in its order: scenes, then as in the paper
    "overview": "At a glance",
    "scenes": "Scenes to open",
    "data": "Data sets and views",
    "fitting": "Quality of the fits",
    "pse": "Edits of colour, opacity and light",
    "relight": "Other lights",
    "time": "Through time",
    "image": "Looks from pictures",
    "text": "Looks from words",
    "parts": "Segments and other edits",
    "ablations": "Sweeps and ablations",
    "sizes": "Sizes of models",
    "rendering": "Speed of rendering",
    "study": "User study",
    "differences": "Where we differ from the paper",
    "more": "Further tables and figures",
}


class Result:
    """Base of the results of jobs, which are dataclasses; files name a result by its class."""

    kinds: ClassVar[dict[str, type[Any]]] = {}
    pictured_in: ClassVar[str]  # section of the report for the job's pictures

    def __init_subclass__(cls, section: str = "more") -> None:
        """Register a kind of result with the section of the report for its pictures."""
        if section not in SECTIONS:
            known = close(section, SECTIONS) or f"; there are {', '.join(SECTIONS)}"
            raise ConfigError(f"{cls.__module__}: {cls.__name__}: section: no section {section}{known}")
        cls.pictured_in = section
        Result.kinds[cls.__name__] = cls

    @classmethod
    def of(cls, numbers: Mapping[str, Any]) -> Any:
        """Read a result that `as_mapping` wrote; raise a ValueMismatch for others."""
        return typed(cls, numbers)


@dataclass(frozen=True)
class VolumeResult(Result, section="data"):
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
class ViewsResult(Result, section="data"):
    """Views of a basic transfer function."""

    train: int  # views
    test: int
    width: int
    height: int
    coverage: float | None = None  # mean share of visible pixels
    frame_ms: float | None = None  # median, without the first frame
    frame_max_ms: float | None = None
    first_frame_ms: float | None = None
    frames_ms: list[float] = field(default_factory=list)
    vtk_frame_ms: float | None = None  # median of VTK, if measured


@dataclass(frozen=True)
class SheetResult(Result, section="data"):
    """A contact sheet of views."""

    train: int  # number of views
    test: int
    width: int
    height: int


@dataclass(frozen=True)
class FitResult(Result, section="fitting"):
    """A phase of a fit."""

    fit_seconds: float
    primitives: int
    iterations: int = 0
    losses: list[float] = field(default_factory=list)  # recorded over the iterations
    psnr: float | None = None  # of test views, dB
    object_psnr: float | None = None  # the same on the object
    shown: float | None = None  # share of the views that the field shows, see `shown_share`
    ssim: float | None = None
    train_psnr: float | None = None
    train_ssim: float | None = None
    relit_psnr: float | None = None  # of test views under lights that no training view has
    relit_ssim: float | None = None
    train_views: int | None = None
    width: int | None = None  # size of all compared views, pixels
    height: int | None = None
    peak_gpu_memory_mib: float | None = None
    sizes: dict[str, float] = field(default_factory=dict)  # of the last phase, see `Field.sizes`
    material: dict[str, float] = field(default_factory=dict)  # medians of its factors, by name
    notes: dict[str, Any] = field(default_factory=dict)  # for people


@dataclass(frozen=True)
class ComparisonResult(Result, section="fitting"):
    """Fits side by side."""

    recipes: list[str]
    shown: list[str]  # views


@dataclass(frozen=True)
class Shown:
    """One picture of a gallery."""

    grid: str
    row: str
    column: str
    psnr: float | None = None  # against the volume, dB; for pictures of the difference


@dataclass(frozen=True)
class GalleryResult(Result):
    """Scenes side by side."""

    section: str  # of the report
    shown: list[Shown]


@dataclass(frozen=True)
class MeshResult(Result, section="fitting"):
    """The surface of a fit against its volume's surface; lengths in world units."""

    chamfer: float  # mean of accuracy and completeness
    accuracy: float  # mean distance of the mesh from the surface
    completeness: float  # mean distance of the surface from the mesh
    f_score: float  # F-score of points within the tolerance, in [0, 1]
    normal_angle: float  # degrees
    vertices: int
    triangles: int
    mesh_seconds: float
    tolerance: float
    visible: float  # share of the surface in training views; the rest does not count


@dataclass(frozen=True)
class SceneResult(Result, section="overview"):
    """Fields as one scene."""

    models: int
    primitives: int


COMPARED_VIEWS = 3  # views around the object; one is shown
BELOW_WORDS = (
    "; below each the volume with the same edit, and the error of the worst channel, four times enlarged."
)


@dataclass(frozen=True)
class ViewComparison:
    """An edit by numbers, against the volume with the same edit."""

    title: str
    psnr: float | None = None  # means over views, dB
    ssim: float | None = None
    object_psnr: float | None = None
    object_ssim: float | None = None
    shown: float | None = None  # share of the volume's view, see `shown_share`


@dataclass(frozen=True)
class CheckResult:
    """Agreement of random views, lights and edits with the volume."""

    sentence: str  # bounds for further views; each number holds by itself
    models: str  # their checksum
    views: int
    seed: int
    width: int  # size of the views, pixels
    height: int
    psnr: dict[str, float]  # mean, percentile_5, worst and floor, dB
    object_psnr: dict[str, float]
    shown: dict[str, float]  # the same statistics of the share shown


@dataclass(frozen=True)
class PseResult(Result, section="pse"):
    """Edits by numbers, and a light that moves."""

    views: int
    pse: list[ViewComparison]
    relight: list[ViewComparison]
    check: CheckResult | None = None


@dataclass(frozen=True)
class StepsResult(Result, section="time"):
    """A scene that follows its volume through the steps of a series in time."""

    steps: int
    views: int  # per compared step
    step_mib: float  # size that a step adds
    compared: list[ViewComparison]  # some steps, by name
    step_seconds: float | None = None  # mean, with its volume; None for a resumed job


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
class PageResult(Result, section="scenes"):
    """A scene as a page for a browser."""

    edit: str  # or "none"
    primitives: int
    page_mib: float


@dataclass(frozen=True)
class EditResult(Result, section="parts"):
    """A scene with a new look or a new part."""

    edit: str
    method: str
    how: str  # means of the method
    edit_seconds: float
    lambda_s: float | None = None
    notes: dict[str, Any] = field(default_factory=dict)  # for people
    follows: str = ""  # "style" or "instruction"
    followed: dict[str, str] = field(default_factory=dict)  # picture or instruction, by model
    iterations: int = 0  # per part
    losses: dict[str, list[float]] = field(default_factory=dict)  # over iterations, by part and term
    is_compared: bool = False  # see `edit.compared`
    opacity: dict[str, float] = field(default_factory=dict)  # factors of the look, by part

    @property
    def lifted(self) -> str:
        """Describe which parts became more or less opaque, or ""."""
        words = ", ".join(f"{part} × {factor:g}" for part, factor in self.opacity.items())
        return f"opacity of {words}" if words else ""


@dataclass(frozen=True)
class EditMeasures(Result):
    """Measures of an edited scene."""

    edit: str
    method: str
    width: int | None = None  # size of the frames, pixels
    height: int | None = None
    values: dict[str, Any] = field(default_factory=dict)  # of texgs/metrics/edits, by name

    @classmethod
    def of(cls, numbers: Mapping[str, Any]) -> Self:
        """Read measures that `as_mapping` wrote; `texgs.metrics` checks the `values`."""
        own = {each.name for each in fields(cls)} - {"values"}
        known = {name: value for name, value in numbers.items() if name in own}
        values = {name: value for name, value in numbers.items() if name not in own}
        return typed(cls, {**known, "values": values})


def as_mapping(result: Result) -> dict[str, Any]:
    """Convert a result for JSON, without missing measures; `values` are merged into the rest."""
    numbers: dict[str, Any] = asdict(result)  # type: ignore[call-overload]
    numbers |= numbers.pop("values", {})
    return {name: value for name, value in numbers.items() if value is not None}
