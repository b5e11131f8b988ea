"""Readers of labels, each with a small whole file of its kind to damage."""

from functools import partial
from pathlib import Path

import numpy as np

from tests.fuzz.volumes import Reader, at
from tests.volume.test_label_names import FREESURFER, SNAP, layered, written
from texgs.config.label_tfs import label_tfs
from texgs.volume.grid import Grid
from texgs.volume.label_choice import labels_in
from texgs.volume.label_masks import MaskSource
from texgs.volume.label_names import read_table, segments_of
from texgs.volume.nrrd_file import masks_in
from texgs.volume.prepare import prepare_channels
from texgs.volume.settings import VolumeKeys, open_labels, open_masks
from texgs.volume.slabs import ArraySource


def functions_of_table(path: Path) -> None:
    """Of each label in the table, as `texgs new --names` makes them."""
    label_tfs(read_table(path))


def masks_of_segments(path: Path) -> None:
    """Of all segments, as `texgs new` and then `texgs volume` make them."""
    volume = VolumeKeys(file=str(path), kind="labels")
    found = labels_in(partial(open_labels, volume, path), segments_of(path))
    for mask in open_masks(volume, path, [each.name for each in found]):
        mask.slices(0, mask.dims[2])


def image_with_masks(path: Path) -> None:
    labels = np.arange(60, dtype=np.uint8).reshape(3, 4, 5) % 3
    masks = [MaskSource(ArraySource(Grid(labels)), number) for number in (1, 2)]
    prepare_channels([ArraySource(Grid(labels.astype(np.float32))), *masks], path)


def read_masks(path: Path) -> None:
    for mask in masks_in(path).values():
        mask.slices(0, mask.dims[2])


LABELS: dict[str, Reader] = {
    "table of ITK-SNAP": Reader(at("seg.label", written, SNAP), functions_of_table),
    "table of FreeSurfer": Reader(at("lut.txt", written, FREESURFER), functions_of_table),
    "segments.nrrd": Reader(lambda folder: layered(folder / "a.seg.nrrd")[0], masks_of_segments),
    "masks in a volume": Reader(at("volume.nrrd", image_with_masks), read_masks),
}
