"""Images of OME-Zarr, written as their specification says, by the library Zarr alone."""

import shutil
from pathlib import Path

import numpy as np
import zarr

LABELS = ("DAPI", "GFP", "RFP")
UNITS = {"micrometer": ("z", "y", "x")}


def axes_of(names, unit="micrometer"):
    """The axes of an image by the letters t, c, z, y, x."""
    kinds = {"t": {"type": "time", "unit": "second"}, "c": {"type": "channel"}}
    return [{"name": name, **kinds.get(name, {"type": "space", "unit": unit})} for name in names]


def write_image(
    path, levels, axes, scales, translations=None, *, version="0.5", labels=(), more=None, **options
):
    """Write arrays as the levels of an image into a new folder of format 3, or 2 for version 0.4.

    Labels are those of channels, or all that OMERO keeps of them. Options are those of Zarr's `create_array`.
    """
    group = zarr.open_group(path, mode="w", zarr_format=2 if version == "0.4" else 3)
    add_image(group, levels, axes, scales, translations, version=version, labels=labels, more=more, **options)
    return Path(path)


def add_image(
    group, levels, axes, scales, translations=None, *, version="0.5", labels=(), more=None, **options
):
    """Write levels and metadata into a group."""
    datasets = []
    for k, (values, scale) in enumerate(zip(levels, scales, strict=True)):
        array = group.create_array(
            f"s{k}", shape=values.shape, dtype=values.dtype, **{"chunks": "auto", **options}
        )
        array[:] = values
        transforms = [{"type": "scale", "scale": list(scale)}]
        if translations:
            transforms.append({"type": "translation", "translation": list(translations[k])})
        datasets.append({"path": f"s{k}", "coordinateTransformations": transforms})
    said = {"multiscales": [{"axes": axes, "datasets": datasets, "name": "image", **(more or {})}]}
    if labels:
        channels = [each if isinstance(each, dict) else {"label": each, "color": "FFFFFF"} for each in labels]
        said["omero"] = {"channels": channels}
    if version == "0.4":
        said["multiscales"][0]["version"] = version
        group.attrs.update(said)
    else:
        group.attrs["ome"] = {"version": version, **said}


def zipped(folder, target, inner=False):
    """Zip what is in a folder, or the folder itself."""
    base = {"root_dir": folder.parent, "base_dir": folder.name} if inner else {"root_dir": folder}
    return Path(shutil.make_archive(str(target), "zip", **base))


def all_axes(values, steps=2, channels=3):
    """[T, C, Z, Y, X]: step t and channel c of an array are 100 t + 10 c above it."""
    return np.stack([np.stack([values + 100 * t + 10 * c for c in range(channels)]) for t in range(steps)])
