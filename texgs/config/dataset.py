"""The schema of conf/dataset: a volume with its basic transfer functions and their meshes."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from texgs.core.keys import REQUIRED, key
from texgs.core.names import mask_name
from texgs.volume.basic_tfs import BasicTF
from texgs.volume.settings import VolumeKeys
from texgs.volume.view_settings import LARGEST


@dataclass(frozen=True)
class LookKeys:
    """Looks of a basic scene in the edits of a whole experiment."""

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
    volume: VolumeKeys = key(VolumeKeys, "where the scalar field comes from")
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
        """Return the names of the basic TFs that determine the frame of all views."""
        return self.framed_by or list(self.basic_tfs)

    @property
    def channels(self) -> list[str]:
        """Return the channels that basic TFs name, in order; empty if `volume.channel` chooses one."""
        named = dict.fromkeys(tf.channel for tf in self.basic_tfs.values())
        return [channel for channel in named if channel is not None]

    @property
    def labels(self) -> list[str]:
        """Return the labels that basic TFs name, in order."""
        named = dict.fromkeys(label for tf in self.basic_tfs.values() for label in (tf.label, tf.within))
        return [label for label in named if label is not None]

    @property
    def prepared(self) -> list[str]:
        """Return the names of all channels of the prepared volume: those of the image, then masks."""
        own = [] if self.volume.kind == "labels" else self.channels or [""]
        return [*own, *map(mask_name, self.labels)]


def dataset_of(
    name: str, file: str | Path, basic_tfs: Mapping[str, BasicTF] | None = None, **volume: Any
) -> Dataset:
    """Return the data set of one volume file, read with the settings of `VolumeKeys`."""
    keys = VolumeKeys(**{**volume, "file": str(file)})
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
