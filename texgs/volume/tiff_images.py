"""Images of TIFF files: which one is read, its axes and spacing; and folders of single TIFFs."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from math import prod
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from texgs.core.errors import ArgumentError
from texgs.core.names import SLICES, natural_order
from texgs.volume.axes import METRES, Axis, Channel
from texgs.volume.grid import Triple


def file_of(page: Any) -> Path:
    """Return the file that a page is in: an OME-TIFF may be in several."""
    return Path(page.parent.filehandle.path)


def images_in(tiff: Any) -> list[Any]:
    """Return the images of a file as series of pages; planes that are alike are slices, but none of OME."""
    import tifffile

    groups: dict[Any, list[Any]] = {}
    for number, series in enumerate(tiff.series):
        plane = series.keyframe
        is_loose = series.kind == "generic" or (series.kind != "ome" and series.size == prod(plane.shape))
        groups.setdefault((plane.shape, series.dtype) if is_loose else number, []).append(series)
    for key, group in groups.items():
        if len(group) > 1:
            pages = sorted((page for series in group for page in series), key=lambda page: page.treeindex)
            axes = f"I{pages[0].keyframe.axes}"
            groups[key] = [tifffile.TiffPageSeries(pages, (len(pages), *key[0]), key[1], axes)]
    return [group[0] for group in groups.values()]


def is_set(images: Sequence[Any], files: Sequence[Path]) -> bool:
    """Return whether files form one OME-TIFF, which needs its own folder."""
    names = {file_of(page).name for image in images for page in image if page is not None}
    others = [file.name for file in files if file.name not in names]
    if len(names) > 1 and others:
        raise ArgumentError(
            f"{files[0].name} and {others[0]}: expected the files of one OME-TIFF, the second is not of it; "
            "move it away"
        )
    return len(names) > 1


def choose_image(images: Sequence[Any], wanted: str | None, tiff: Any) -> tuple[Any, str]:
    """Return an image by name or number, with a note about a default choice.

    That is the only volume, or the only one with pages in an open file, which may be None.
    """
    volumes = {str(k): image for k, image in enumerate(images) if is_volume(image)} or {"0": images[0]}
    fits, why = [*volumes], "the only volume"
    if wanted is not None:
        fits = [k for k, image in volumes.items() if str(wanted) in (k, image.name)]
    elif len(volumes) > 1:
        fits = [k for k, image in volumes.items() if any(page and page.parent is tiff for page in image)]
        why = "the only one with pages in this file"
    if len(fits) == 1:
        is_told = wanted is None and len(images) > 1
        return volumes[fits[0]], f"image {fits[0]} of {len(images)}, {why}" if is_told else ""
    sizes = (f"{image.name} {' x '.join(map(str, image.shape[::-1]))}".strip() for image in volumes.values())
    listed = ", ".join(map("{} ({})".format, volumes, sizes))
    raise ArgumentError(f"dataset.volume.image: expected one of {listed}, got {wanted or 'none'}")


def is_volume(image: Any) -> bool:
    """Return whether an image has three axes besides channels, and is no smaller copy of another one."""
    sizes = zip(image.axes, image.shape, strict=True)
    return sum(n > 1 and axis not in "CS" for axis, n in sizes) > 2 and not image.keyframe.is_reduced


def axes_of(image: Any, labels: Sequence[str]) -> tuple[list[Axis], str]:
    """Return the axes of an image before Y and X, with a remark if time replaces z."""
    letters, shape = image.get_axes(squeeze=False).rstrip("S"), image.get_shape(squeeze=False)
    if not letters.endswith("YX"):
        raise ArgumentError(f"expected pages with Y and X, got the axes {letters}; store it again so")
    known = {("C", len(labels)): tuple(map(Channel, labels))} if all(labels) else {}
    sizes = zip(letters[:-2], shape, strict=False)
    axes = [Axis(name, n, channels=known.get((name, n), ())) for name, n in sizes]
    is_long = {axis.kind for axis in axes if axis.size > 1}
    if "space" in is_long or "time" not in is_long:
        return axes, ""
    axes = [replace(axis, name="z") if axis.kind == "time" else axis for axis in axes]
    return axes, "its steps of time are taken for slices, as there are no others"


def spacing_and_labels(image: Any, tiff: Any, images: Sequence[Any]) -> tuple[Triple | None, list[str]]:
    """Return the spacing x, y, z, in the unit of x, as OME or ImageJ tells, and OME's labels of channels."""
    if not tiff.is_ome:
        depth = (tiff.imagej_metadata or {}).get("spacing")
        tags = [image.keyframe.tags.get(name) for name in ("XResolution", "YResolution")]
        if not depth or not all(tag and tag.value[0] for tag in tags):
            return None, []
        dx, dy = (tag.value[1] / tag.value[0] for tag in tags)  # pixels in a unit
        return (dx, dy, abs(float(depth))), []  # below 0 for slices from the top down, by ImageJ
    root = ElementTree.fromstring(tiff.ome_metadata)
    if (other := root.find("{*}BinaryOnly")) is not None:
        raise ArgumentError(
            f"expected a whole OME-TIFF, got a part of {other.get('MetadataFile')}; open that one, or make "
            "one file of all, by bfconvert of Bio-Formats, say"
        )
    known = root.findall("{*}Image")
    alike = [each for each in known if each.get("Name") == image.name]
    fits = [known[list(images).index(image)]] if len(known) == len(images) else alike
    if len(fits) != 1:
        return None, []
    pixels = fits[0].findall("{*}Pixels")[0]
    return _of_ome(pixels.attrib), [each.get("Name", "") for each in pixels.findall("{*}Channel")]


def _of_ome(pixels: Mapping[str, str]) -> Triple | None:
    """Return the spacing of an image by OME, in the unit of x; None if it does not tell all three."""
    units = [METRES.get(pixels.get(f"PhysicalSize{axis}Unit", "µm"), 0.0) for axis in "XYZ"]
    x, y, z = (
        float(pixels.get(f"PhysicalSize{axis}", 0)) * unit for axis, unit in zip("XYZ", units, strict=True)
    )
    return (x / units[0], y / units[0], z / units[0]) if min(x, y, z) > 0 else None


def require_pages(image: Any, pages: Sequence[Any]) -> None:
    """Require pages of an image that are there: an OME-TIFF may be in several files."""
    if lost := sum(page is None for page in pages):
        folder = file_of(image.keyframe).parent
        names = dict.fromkeys(re.findall(r'FileName="([^"]+)"', image.parent.ome_metadata or ""))
        absent = ", ".join([name for name in names if not (folder / name).exists()][:3]) or "the files"
        raise ArgumentError(
            f"{lost} of {len(pages)} slices are missing; put {absent} of the same OME-TIFF beside this file"
        )


def tiffs_in(folder: Path) -> list[Path]:
    """Return the TIFF files of a folder in natural order: slice9 comes before slice10."""
    files = (file for file in folder.iterdir() if not file.name.startswith("."))  # as ._ files of macOS
    return sorted((file for file in files if file.suffix.lower() in SLICES), key=natural_order)


def arrange(files: Sequence[Path]) -> tuple[list[Axis], list[Path]]:
    """Return the axes that numbers in the names count, and the files in their order, the last axis fastest.

    One number counts slices, by even steps. Others may count steps of time and channels, if the word before
    them says so (t, time, c, ch, channel) and there is a file for each combination.
    """
    parts = [re.split(r"(\d+)", file.stem) for file in files]  # text, number, text, number, ..., text
    texts = parts[0][::2]
    other = next((file for file, part in zip(files, parts, strict=True) if part[::2] != texts), None)
    columns = list(zip(*(map(int, part[1::2]) for part in parts), strict=other is None))
    varied = [k for k, column in enumerate(columns) if len(set(column)) > 1]
    axes = [_axis(texts[k] if len(varied) > 1 else "z", sorted(set(columns[k]))) for k in varied]
    slices = [k for k, axis in zip(varied, axes, strict=True) if axis.kind == "space"]
    if other or (len(files) > 1 and (len(slices) != 1 or prod(axis.size for axis in axes) != len(files))):
        raise ArgumentError(
            f"{files[0].name} and {(other or files[-1]).name}: expected names that differ by the number of "
            "the slice, or by others after t, c or ch, too; move the slices of one volume into a folder of "
            "their own, or rename them"
        )
    for k in slices:
        _require_even(dict(zip(columns[k][::-1], files[::-1], strict=True)))
    places = dict(zip(files, zip(*(columns[k] for k in varied), strict=True), strict=False))
    return axes, sorted(files, key=lambda file: places.get(file, ()))


def _axis(text: str, values: Sequence[int]) -> Axis:
    """Return the axis that a number counts, by the word before it."""
    word = re.split(r"[\W\d_]", text.lower())[-1]
    return Axis(word, len(values), channels=tuple(Channel(str(value)) for value in values))


def _require_even(files: dict[int, Path]) -> None:
    """Require that the numbers of slices, each with a file, have no gap."""
    pairs = list(pairwise(sorted(files)))
    step = min(after - before for before, after in pairs)
    for before, after in pairs:
        if after - before != step:
            raise ArgumentError(
                f"{files[before].name} and {files[after].name}: expected numbers {step} apart, as of other "
                f"slices, got {after - before}; add those that are missing, or rename the files"
            )
