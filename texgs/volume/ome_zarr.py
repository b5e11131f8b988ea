"""Zarr folders and zips (formats 2 and 3), with the levels, axes and channels of OME-Zarr (0.4 and 0.5)."""

from __future__ import annotations

import posixpath
import re
import warnings
from base64 import b64decode
from collections.abc import Mapping
from itertools import chain
from math import prod
from pathlib import Path, PurePosixPath
from typing import Any
from zipfile import ZipFile

import numpy as np

from texgs.core.io import reading_as
from texgs.core.memory import room_for_volume
from texgs.core.names import is_number
from texgs.volume.axes import Axis, Channel, attributes_of, axes_of, nameless
from texgs.volume.grid import Triple
from texgs.volume.layers import LayerSource, gaps_in, one_of

METADATA = ("zarr.json", ".zgroup", ".zarray")  # files of a node: of format 3, and of format 2
SHORT: dict[Any, str] = {"time": "t", "channel": "c"}  # names of axes, by types of OME-Zarr


def is_zarr(folder: Path) -> bool:
    """Return whether a folder holds an array or a group of Zarr."""
    return any((folder / name).is_file() for name in METADATA)


def open_zarr(
    path: Path, spacing: Triple | None, origin: Triple | None, variable: str | None = None, **keys: Any
) -> LayerSource:
    """Open an array of a Zarr folder or zip by its path, or an image; further keys are as in `LayerSource`.

    Of an image it is the finest level whose samples take at most half of the free memory, as the volume that
    is prepared from it should; else the coarsest. A note says which, unless it is the finest of all.
    """
    import zarr

    with reading_as("a folder or zip of Zarr"), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of files beside arrays, and of what is new in the format
        root, note = _root(path), ""
        nodes = {"": root} | (dict(root.members(max_depth=None)) if isinstance(root, zarr.Group) else {})
        images = {name: levels for name in nodes if (levels := _levels(name, nodes))}
        arrays = {name: node for name, node in nodes.items() if isinstance(node, zarr.Array)}
        arrays |= {name: nodes[next(iter(levels))] for name, levels in images.items()}
        groups = {posixpath.normpath(name) for name in images}  # "." at the root, as of their parents
        is_inner = {k: not groups.isdisjoint(map(str, PurePosixPath(k).parents)) for k in arrays}
        outer = {k: node for k, node in arrays.items() if not is_inner[k]}
        name = one_of(arrays if variable else outer, variable)
        if name in images:
            name, note = _fitting(list(images[name]), nodes)
        known = {level: axes for levels in images.values() for level, axes in levels.items()}
        array = nodes[name]
        axes, attributes = known.get(name) or _labels(name, nodes), attributes_of(array)
        # The code of missing samples as xarray writes it: in format 2 by other means, in format 3 packed.
        is_of_xarray = array.metadata.zarr_format == 2 and "_ARRAY_DIMENSIONS" in array.attrs
        if is_of_xarray and array.fill_value is not None:
            attributes = {"_FillValue": array.fill_value, **attributes}
        if isinstance(code := attributes.get("_FillValue"), str):
            attributes["_FillValue"] = np.frombuffer(b64decode(code), "<f8")
        pieces = array.shards or array.chunks
        n_written = array.nchunks_initialized * prod(array.chunks) // prod(pieces)
        gaps = gaps_in(array, pieces, n_written, array.fill_value)
        note, chunks = "; ".join(filter(None, (note, gaps))), array.chunks
        return LayerSource(path, array, axes, attributes, (spacing, origin), chunks=chunks, note=note, **keys)


def _root(path: Path) -> Any:
    """Return the array or group at the root, which may be in a folder of the zip."""
    import zarr
    from zarr.storage import LocalStore, ZipStore

    if path.is_dir():
        return zarr.open(LocalStore(path, read_only=True), mode="r")
    with ZipFile(path) as file:
        tops = {name.split("/")[0] for name in file.namelist()}
    folder = tops.pop() if len(tops) == 1 and tops.isdisjoint(METADATA) else ""
    return zarr.open(ZipStore(path, mode="r"), mode="r", path=folder)


def _levels(name: str, nodes: Mapping[str, Any]) -> dict[str, list[Axis]]:
    """Return the paths of the levels of an image with their axes, the finest first; none for other nodes."""
    said = nodes[name].attrs.get("ome", nodes[name].attrs)  # of 0.5, of 0.4
    if not said.get("multiscales"):
        return {}
    image, levels = said["multiscales"][0], {}
    channels = tuple(map(_channel, said.get("omero", {}).get("channels", ())))
    # Versions before 0.4 only name their axes, or not even that, and have no transformations.
    said_axes: Any = image.get("axes", "tczyx")
    axes = [{"name": each} if isinstance(each, str) else each for each in said_axes]
    names = [SHORT.get(axis.get("type"), axis["name"]) for axis in axes]
    units = [axis.get("unit", "") for axis in axes]
    for level in image["datasets"]:
        steps, starts = np.ones(len(axes)), np.zeros(len(axes))
        transforms = [each.get("coordinateTransformations", ()) for each in (level, image)]
        for each in chain(*transforms):
            scale, shift = each.get("scale", 1.0), each.get("translation", 0.0)
            steps, starts = steps * scale, starts * scale + shift
        path = posixpath.normpath(posixpath.join(name, level["path"]))
        lines = zip(names, nodes[path].shape, units, starts.tolist(), steps.tolist(), strict=True)
        own = {len(channels): channels}  # of the axis that has so many
        levels[path] = [Axis(*line, channels=own.get(line[1], ()), letter=line[0]) for line in lines]
    return levels


def _channel(said: Mapping[str, Any]) -> Channel:
    """Return a channel from the metadata for OMERO, with display colour and window."""
    window, color, label = said.get("window") or {}, str(said.get("color", "")), str(said.get("label", ""))
    start, end = (window.get(key, "") for key in ("start", "end"))
    if not (re.fullmatch("[0-9A-Fa-f]{6}", color) and is_number(start) and is_number(end) and start < end):
        return Channel(label)
    red, green, blue = (byte / 255 for byte in bytes.fromhex(color))
    return Channel(label, (red, green, blue), (start, end))


def _fitting(levels: list[str], nodes: Mapping[str, Any]) -> tuple[str, str]:
    """Return the finest level that fits, or the last one, with a note unless it is the finest."""
    room = room_for_volume()
    sizes = [prod(nodes[each].shape[-3:]) * nodes[each].dtype.itemsize for each in levels]
    name = next((each for each, size in zip(levels, sizes, strict=True) if size <= room), levels[-1])
    note = f"level {name} of {', '.join(levels)}, by the memory that is free"
    return name, "" if name == levels[0] else f"{note}; dataset.volume.variable={levels[0]} takes the finest"


def _labels(name: str, nodes: Mapping[str, Any]) -> list[Axis]:
    """Return the axes of an array that is no level, by their names and the coordinates that are beside it."""
    array, folder = nodes[name], posixpath.dirname(name)
    names = getattr(array.metadata, "dimension_names", None) or array.attrs.get("_ARRAY_DIMENSIONS")
    if not names or None in names:
        return axes_of(nameless(array.shape), array.shape, {})
    places = {each: nodes.get(posixpath.join(folder, each)) for each in names}
    return axes_of(names, array.shape, places)
