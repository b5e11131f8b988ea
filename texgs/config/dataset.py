"""The schema of conf/dataset: a volume with its basic transfer functions, and of the meshes of these."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from texgs.core.keys import REQUIRED, key

AXES = ("+x", "-x", "+y", "-y", "+z", "-z")
LARGEST = 16384  # pixels of a side of a view


@dataclass(frozen=True)
class Volume:
    """Where the scalar field of a data set comes from: a generator, or a file that is there or downloaded."""

    generator: str | None = key(
        None,
        "name of a built-in field",
        choices=("sphere", "orbital", "turbulence", "jets", "rings", "flame"),
    )
    size: int = key(128, "samples along each side of a generated field", least=16)
    seed: int = key(0, "seed of a generated field", least=0)
    file: str | None = key(
        None, "file, or folder of TIFF or DICOM slices, or of Zarr; relative to data_folder"
    )
    series: str | None = key(
        None,
        "number or UID of the series to read of a folder of DICOM slices; all: those alike are steps in time",
    )
    variable: str | None = key(
        None, "array to read, by its path in the file, where Zarr, HDF5, NetCDF or VTK has several"
    )
    image: str | None = key(
        None, "name or number of the image to read, from 0, where TIFF has several, as positions of a stage"
    )
    channel: str | None = key(None, "label or number of the channel to read, from 0, where there are several")
    time: int = key(0, "step to read or make, from 0, where there are several", least=0)
    steps: int = key(1, "steps of a generated field that changes in time: rings or flame", least=1)
    column: int | None = key(None, "number of the column to read, from 1, where text has several", least=1)
    url: str | None = key(None, "where the file is downloaded from when it is not there")
    sha256: str | None = key(None, "checksum of the download")
    obtain: str = key("", "how to get a file that cannot be downloaded")
    dims: list[int] | None = key(None, "samples along x, y, z; of raw files and text", "samples")
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


@dataclass(frozen=True)
class BasicTF:
    """A basic transfer function: piecewise linear opacity and colour over one range of values."""

    # OmegaConf takes no integers for list[list[float]]; the points are checked where the TF is made.
    opacity: list[Any] = key([], "points [value, opacity]; opacity is 0 outside")
    color: list[Any] = key([], "points [value, r, g, b], linear, 0 to 1")
    channel: str | None = key(
        None, "label or number of the channel of these values, from 0, where the data set shows several"
    )


@dataclass(frozen=True)
class LookKeys:
    """What the edits of a whole experiment make of a basic scene."""

    style: str = key("strokes", "style of edits by a picture: one that texgs paints, or a picture file")
    instruction: str = key("make it gold", "instruction of edits by an instruction")
    caption: str = key("a rendering of a volume", "the basic scene in words, for CLIP's metrics")
    styled: str = key("a painting with brush strokes", "the scene after an edit by the picture, in words")
    instructed: str = key("a sculpture of gold", "the scene after an edit by the instruction, in words")


@dataclass(frozen=True)
class PartKeys:
    """A part of a basic scene, by clicks on a view of it; the edit `part` makes it a segment."""

    model: str = key("", "basic TF that it is a part of")
    view: list[float] = key([30.0, 20.0], "azimuth and polar angle of the view clicked on", "degrees")
    points: list[Any] = key([], "clicks on it: right and down, as shares of the view's sides")
    alone: list[str] = key([], "changes that hide the other basic scenes, such as TF01.visible=false")


@dataclass(frozen=True)
class Dataset:
    """A volume with its basic transfer functions, or a folder of views."""

    name: str = key(REQUIRED, "name of the data set, and of its folder below results/")
    title: str = key("${.name}", "name of the data set in pictures of its transfer functions")
    source: str = key("", "who made the data, and its licence")
    stand_in: str = key("", "what the data stand in for, where the real ones are not public")
    image: int = key(800, "width and height of views", "pixels", least=1, most=LARGEST)
    volume: Volume = key(Volume, "where the scalar field comes from")
    series: list[str] = key(
        [], "files of the steps of a series in time, such as step_*.nrrd; volume.file is one of them"
    )
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
    framed_by: list[str] = key([], "basic TFs that frame the views of all; default all of them")
    looks: dict[str, LookKeys] = field(
        default_factory=dict,
        metadata={"help": "what edits with edit.looks make of each basic TF"},
    )
    part: PartKeys = key(PartKeys, "what the edit `part` makes a segment of")

    @property
    def framing(self) -> list[str]:
        """Return the names of the basic TFs that frame the views of all."""
        return self.framed_by or list(self.basic_tfs)

    @property
    def channels(self) -> list[str]:
        """Return the channels that basic TFs name, in their order; none where `volume.channel` says which."""
        named = dict.fromkeys(tf.channel for tf in self.basic_tfs.values())
        return [channel for channel in named if channel is not None]

    def number_of(self, tf: BasicTF) -> int:
        """Return the number of a basic TF's channel among those that are prepared."""
        return 0 if tf.channel is None else self.channels.index(tf.channel)


def dataset_of(
    name: str, file: str | Path, basic_tfs: Mapping[str, BasicTF] | None = None, **volume: Any
) -> Dataset:
    """Return the data set of one volume file, which is read as keys of `Volume` say."""
    keys = Volume(**{**volume, "file": str(file)})
    return Dataset(name=name, title=name, volume=keys, basic_tfs=dict(basic_tfs or {}))


@dataclass(frozen=True)
class MeshKeys:
    """Surfaces of fits beside those of their volumes."""

    tfs: list[str] = key([], "basic TFs that get a mesh: those with an opaque surface")
    voxel: float = key(1 / 128, "edge of the cells that depth is fused in", "world units", above=0)
    opacity: float = key(
        0.5, "opacity of a TF, per opacity unit, from which on there is a surface", above=0, below=1
    )
    tolerance: float = key(0.01, "distance that counts as right in the F-score", "world units", above=0)
