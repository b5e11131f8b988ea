"""The checksum of an input that may be more than one file: a header and samples, slices, or views."""

from pathlib import Path

from texgs.core.cache import Checksums, combined_checksum
from texgs.core.errors import ArgumentError
from texgs.core.io import read_json
from texgs.core.names import POINTS, SLICES
from texgs.volume.parts import parts_of


def checksum_of_input(path: Path, checksums: Checksums) -> str:
    """Return the checksum of a file from elsewhere, with the files that belong to it.

    A file in parts, such as a header and its samples, counts with all of them, a folder with its slices or
    all files, and the transforms_train.json of views with all images and points beside it.
    """
    folder = path.parent
    if path.name.startswith("transforms_"):
        members = [each for each in folder.rglob("*") if each.suffix in (".json", ".png")]
        members += [points for points in [folder / POINTS] if points.is_file()]
        members += images_outside(folder)
    elif path.is_dir():
        files = [each for each in path.rglob("*") if each.is_file()]  # chunks and DICOM have any suffix
        members = [each for each in files if each.suffix.lower() in SLICES] or files
    elif parts := parts_of(path):
        return combined_checksum((each.name, checksums.of(each)) for each in (path, *parts))
    else:
        return checksums.of(path)
    return combined_checksum(
        (str(each.relative_to(folder) if each.is_relative_to(folder) else each), checksums.of(each))
        for each in members
    )


def images_outside(folder: Path) -> list[Path]:
    """Return the images that files of views name and that do not lie below their folder."""
    images = set[Path]()
    for file in folder.glob("transforms_*.json"):
        try:
            frames = read_json(file)["frames"]
            images |= {folder / f"{str(frame['file_path']).removesuffix('.png')}.png" for frame in frames}
        except (ArgumentError, KeyError, TypeError):
            continue  # the job reports the error
    apart = (image for image in images if not image.resolve().is_relative_to(folder.resolve()))
    return sorted(image for image in apart if image.is_file())
