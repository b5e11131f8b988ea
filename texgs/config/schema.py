"""The typed schema of conf/: every key with its type, default, unit and meaning.

Hydra merges the YAML files into these classes, so an unknown key or a value of the wrong type is an error
that names the key; `texgs VERB --help` prints this file.
"""

from dataclasses import dataclass, field
from typing import Any

from omegaconf import II, MISSING

from texgs.config.edit import Edit
from texgs.config.fit import Fit
from texgs.config.keys import key
from texgs.core.lens import Lens

LENS = Lens()
AXES = ("+x", "-x", "+y", "-y", "+z", "-z")


@dataclass
class Volume:
    """Where the scalar field of a data set comes from: a generator, or a file that is there or downloaded."""

    generator: str | None = key(
        None, "name of a built-in field", choices=("sphere", "orbital", "turbulence", "jets")
    )
    size: int = key(128, "samples along each side of a generated field", least=16)
    seed: int = key(0, "random numbers of a generated field")
    file: str | None = key(None, "file, or folder of TIFF slices; relative to data_folder")
    url: str | None = key(None, "where the file is downloaded from when it is not there")
    sha256: str | None = key(None, "checksum of the download")
    obtain: str = key("", "how to get a file that cannot be downloaded")
    dims: list[int] | None = key(None, "samples along x, y, z; of raw files", "samples")
    dtype: str | None = key(None, "type of the samples of raw files, such as uint8 or float32")
    endian: str = key("little", "byte order of raw files", choices=("little", "big"))
    skip: int = key(0, "header of raw files", "bytes", least=0)
    spacing: list[float] | None = key(None, "distance of samples along x, y, z; default the file's", "length")
    origin: list[float] | None = key(None, "position of the first sample; default the file's", "length")
    crop: list[int] | None = key(None, "part to keep: x0, x1, y0, y1, z0, z1, half open", "samples")
    reduce: int = key(1, "factor by which every side is made smaller on reading", least=1)
    method: str = key("mean", "how samples are reduced; labels must be sampled", choices=("mean", "sample"))
    up: str = key("+y", "axis of the volume that points up in the world", choices=AXES)
    nan_value: float | None = key(None, "replaces NaN; without it NaN is an error")


@dataclass
class BasicTF:
    """A basic transfer function: piecewise linear opacity and colour over one range of values."""

    # OmegaConf takes no integers for list[list[float]]; the points are checked where the TF is made.
    opacity: list[Any] = key([], "points [value, opacity]; opacity is 0 outside")
    color: list[Any] = key([], "points [value, r, g, b], linear, 0 to 1")


@dataclass
class Dataset:
    """A volume with its basic transfer functions, or a folder of views."""

    name: str = key(MISSING, "name, also of the folder under results/")
    title: str = key(II(".name"), "name in tables")
    source: str = key("", "who made the data, and its licence")
    stand_in: str = key("", "what the data stand in for, where the real ones are not public")
    image: int = key(800, "width and height of views", "pixels", least=1)
    volume: Volume = key(Volume, "where the scalar field comes from")
    views_folder: str | None = key(
        None, "folder with views of one basic TF per subfolder, instead of a volume"
    )
    tf_values: str = key(
        "data", "values of TFs: of the data, or fractions of its range", choices=("data", "fraction")
    )
    basic_tfs: dict[str, BasicTF] = field(
        default_factory=dict,
        metadata={"help": "basic transfer functions by name; their ranges must not overlap"},
    )


@dataclass
class CameraPath:
    """Where cameras stand around the volume."""

    kind: str = key("icosphere", "arrangement", choices=("icosphere", "spiral", "orbit"))
    frequency: int = key(3, "of the icosphere: 10 f^2 + 2 views", least=1)
    count: int = key(181, "views of a spiral or orbit", least=1)
    polar: float = key(15.0, "angle of an orbit above the horizon", "degrees", least=-90, most=90)


@dataclass
class LightKeys:
    """A light: at the camera, or from a direction given as for cameras on the test path."""

    kind: str = key("headlight", "kind", choices=("headlight", "directional"))
    azimuth: float = key(0.0, "of a directional light", "degrees")
    polar: float = key(0.0, "of a directional light", "degrees")


@dataclass
class Shading:
    """Factors of the Blinn-Phong model; white light."""

    ambient: float = key(0.3, "k_a", least=0)
    diffuse: float = key(0.7, "k_d", least=0)
    specular: float = key(0.3, "k_s", least=0)
    shininess: float = key(20.0, "exponent beta", least=0)


@dataclass
class ViewKeys:
    """Training and test views of a volume."""

    name: str = key("views", "of their folder; a sweep over views has several")
    train: CameraPath = key(CameraPath, "training views")
    test: CameraPath = key(CameraPath, "test views")
    width: int = key(II("dataset.image"), "width of views", "pixels", least=1)
    height: int = key(II("dataset.image"), "height of views", "pixels", least=1)
    fov_y: float = key(LENS.fov_y, "vertical field of view", "degrees", above=0, below=180)
    radius: float = key(
        LENS.radius, "distance of cameras; the volume's longest side is 1", "world units", above=0
    )
    lights: list[LightKeys] = field(
        default_factory=lambda: [LightKeys()],
        metadata={"help": "view i is lit by light i modulo their number"},
    )
    test_lights: list[LightKeys] = field(
        default_factory=list,
        metadata={"help": "the same for test views; default those of `lights`"},
    )
    shading: Shading = key(Shading, "material of the volume")
    step: float = key(0.25, "sample distance along rays", "voxels", above=0)
    opacity_unit: float = key(0.005, "length over which a TF's opacity applies", "world units", above=0)
    mapper: str = key(II("device.mapper"), "volume mapper", choices=("cpu", "gpu"))
    geometry: bool = key(False, "also write depth and normals of the test views, geometry/*.npz; slow")
    turntable: int = key(36, "frames of the turntable", least=1)


@dataclass
class Tracking:
    """Where runs are recorded."""

    uri: str | None = key(None, "sqlite:/// and a file, the address of an MLflow server, or null: not at all")
    experiment: str = key("texgs", "MLflow experiment")


@dataclass
class Device:
    """What the work runs on."""

    name: str = key("cpu", "device of tensors", choices=("cpu", "cuda"))
    mapper: str = key("cpu", "volume mapper", choices=("cpu", "gpu"))


@dataclass
class Metric:
    """What edited scenes are measured with, besides what needs no weights."""

    clip: str = key(
        "clip-vit-base-patch32",
        "backbone of CLIP's metrics, where its weights are on this machine",
        choices=("clip-vit-base-patch32", "clip-vit-large-patch14"),
    )
    views: int = key(12, "of the test path, for style distance, consistency and LPIPS", least=2)


@dataclass
class MeshKeys:
    """Surfaces of fits beside those of their volumes."""

    tfs: list[str] = key([], "basic TFs that get one: those with an opaque surface")
    voxel: float = key(1 / 128, "edge of the cells that depth is fused in", "world units", above=0)
    opacity: float = key(0.5, "of a TF, per opacity unit, that makes a surface", above=0, below=1)
    tolerance: float = key(0.01, "distance that counts as right in the F-score", "world units", above=0)


@dataclass
class Sweep:
    """Variants of an experiment, each with its own overrides, side by side in one table."""

    name: str = key("none", "of the table")
    seeds: list[int] = key([0], "random numbers; each variant runs once with each")
    variants: dict[str, list[str]] = field(
        default_factory=dict, metadata={"help": "overrides by the name of the variant"}
    )


@dataclass
class Config:
    """Everything."""

    dataset: Dataset = key(Dataset, "the data set")
    datasets: list[str] = key([], "data sets of a whole experiment; default the one of `dataset`")
    tf: str | None = key(None, "basic TF to work on; default each of the data set")
    views: ViewKeys = key(ViewKeys, "training and test views")
    fit: Fit = key(Fit, "recipe of the fit")
    fits: list[str] = key([], "recipes of a whole experiment, files of conf/fit; default the one of `fit`")
    edit: Edit = key(Edit, "a new look for the scene")
    edits: list[str] = key([], "edits of a whole experiment, files of conf/edit; default the one of `edit`")
    metric: Metric = key(Metric, "what edits are measured with")
    mesh: MeshKeys = key(MeshKeys, "surfaces of fits beside those of their volumes")
    sweep: Sweep = key(Sweep, "variants of the experiment")
    sweeps: dict[str, str] = field(
        default_factory=dict,
        metadata={"help": "sweeps of a whole experiment beside its data sets: the data set of each"},
    )
    variant: str = key("", "which of the sweep this is, in the folder of its fits")
    tracking: Tracking = key(Tracking, "where runs are recorded")
    device: Device = key(Device, "what the work runs on")
    data_folder: str = key(II("oc.env:TEXGS_DATA,data"), "folder of data files; or set TEXGS_DATA")
    results: str = key("results", "folder of all results")
