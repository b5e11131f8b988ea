"""What a configuration says of a volume, and the field and the prepared file that come from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texgs.core.cache import cache_folder
from texgs.core.errors import ArgumentError, ConfigError
from texgs.core.keys import key
from texgs.core.names import file_name

if TYPE_CHECKING:
    from texgs.volume.slabs import Source
    from texgs.volume.summaries import Summary

AXES = ("+x", "-x", "+y", "-y", "+z", "-z")


@dataclass(frozen=True)
class VolumeKeys:
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
    method: str = key("mean", "how samples are reduced", choices=("mean", "sample"))
    kind: str = key("image", "what samples are; labels have a mask each", choices=("image", "labels"))
    labels: str | None = key(None, "file of labels on the lattice of the image; relative to data_folder")
    label_numbers: dict[str, int] = key(dict, "numbers of labels by name, where the file has no names")
    up: str = key("+y", "axis of the volume that points up in the world", choices=AXES)
    nan_value: float | None = key(None, "replaces NaN; without it NaN is an error")


def prepare_fields(
    volume: VolumeKeys, fields: Sequence[Source], target: Path, progress: Any = None
) -> list[Summary]:
    """Write the canonical file of the channels of a field as settings say."""
    from texgs.volume.prepare import prepare_channels

    return prepare_channels(
        *(fields, target),
        crop=volume.crop and tuple(volume.crop),  # type: ignore[arg-type]
        reduce=volume.reduce,
        method=volume.method,
        up=volume.up,
        nan_value=volume.nan_value,
        progress=progress,
    )


def generated_field(volume: VolumeKeys) -> Source:
    """Return the field of a generator, at its time if it changes."""
    from texgs.volume.generate import GENERATORS, RANDOM_GENERATORS, SERIES
    from texgs.volume.slabs import ArraySource

    name, last = str(volume.generator), volume.steps - 1
    options: dict[str, Any] = {"seed": volume.seed} if name in RANDOM_GENERATORS else {}
    if volume.time > last or (last and name not in SERIES):
        expected = f"a step from 0 to {last}" if name in SERIES else "steps=1"
        raise ArgumentError(
            f"volume: expected {expected} of {name}, got time={volume.time} steps={volume.steps}"
        )
    if name in SERIES:
        options["time"] = volume.time / max(last, 1)
    return ArraySource({**GENERATORS, **SERIES}[name](volume.size, **options), name)


def open_field(volume: VolumeKeys, path: Path | None) -> Source:
    """Return the field of a file, or that of the generator.

    A file that was downloaded is compared with its checksum.
    """
    if path is None:
        return generated_field(volume)
    from texgs.volume.download import require_whole
    from texgs.volume.sources import open_source

    if volume.url and path == cached_volume(volume):
        require_whole(path, volume.sha256 or "")
    given = {"dims": volume.dims, "spacing": volume.spacing, "origin": volume.origin}
    said: dict[str, Any] = {name: values and tuple(values) for name, values in given.items()}
    said |= {"dtype": volume.dtype, "endian": volume.endian, "skip": volume.skip}
    said |= {"series": volume.series, "variable": volume.variable, "column": volume.column}
    said |= {"image": volume.image, "channel": volume.channel, "time": volume.time}
    return open_source(path, **said)


def open_masks(
    volume: VolumeKeys, path: Path, names: Sequence[str], image: Source | None = None
) -> Sequence[Source]:
    """Return the masks of labels in a file, by names or numbers; on the lattice of an image, if any.

    A volume that texgs has prepared has masks instead of labels.

    Raises:
        ArgumentError: if the file has no such label, or another lattice than the image.
    """
    from texgs.volume.label_masks import MaskSource
    from texgs.volume.label_names import place_of_label
    from texgs.volume.nrrd_file import masks_in

    if made := masks_in(path):
        if missing := [name for name in names if name not in made]:
            raise ArgumentError(f"{path}: no such label {missing[0]!r}; expected one of {', '.join(made)}")
        return [made[name] for name in names]
    layer_of = cache(partial(open_labels, volume, path, image=image))
    places = {name: place_of_label(path, name, volume.label_numbers) for name in names}
    return [MaskSource(layer_of(layer), number, name) for name, (layer, number) in places.items()]


def open_labels(volume: VolumeKeys, path: Path, layer: str | None, image: Source | None = None) -> Source:
    """Return a layer of the labels in a file; beside an image, at the place that settings give this."""
    from texgs.volume.label_masks import on_lattice_of

    if image is None:
        return open_field(replace(volume, channel=layer or volume.channel), path)
    beside = VolumeKeys(spacing=volume.spacing, origin=volume.origin, channel=layer)
    return on_lattice_of(open_field(beside, path), image)


def cached_volume(volume: VolumeKeys) -> Path:
    """Return the download path of a volume, which depends on its required checksum."""
    checksum, name = volume.sha256, file_name("dataset.volume.file", Path(volume.file or "").name)
    if not checksum or not checksum.isalnum():
        raise ConfigError(
            f"dataset.volume.sha256: expected the checksum of {volume.url}, got {checksum or 'none'}"
        )
    return cache_folder() / "volumes" / checksum[:12] / name
