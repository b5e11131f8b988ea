"""Readers of volumes, each with a small whole file of its kind to damage."""

from __future__ import annotations

import gzip
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import nibabel
import numpy as np
import pyvista
import tifffile
from SimpleITK import GetImageFromArray, WriteImage
from zarr.codecs import BloscCodec

from tests.volume.dicom_files import frame, write_enhanced, write_phases, write_steps
from tests.volume.test_extra_axis import VALUES as STEPS
from tests.volume.test_extra_axis import write_nrrd
from tests.volume.test_hdf5 import write_labelled
from tests.volume.test_mrc import write as write_map
from tests.volume.test_netcdf import FIELD, write_netcdf
from tests.volume.test_text_columns import LINES, write_lines
from tests.volume.test_tiff import A, folder_of
from tests.volume.test_vtk_image import PLACES, cells, write_pieces
from tests.volume.volume_files import WRITERS, sample_values, write_slc
from tests.volume.zarr_files import axes_of, write_image, zipped
from texgs.volume.prepare import prepare
from texgs.volume.sources import open_source

Pack = Callable[[bytes], bytes]
VALUES, SHORTS = sample_values(), sample_values("int16")
BLOSC = BloscCodec()


@dataclass(frozen=True)
class Reader:
    """One way into the program."""

    make: Callable[[Path], Path]  # writes into a folder; returns the file to open
    read: Callable[[Path], object]  # as the program does it
    victim: str | None = None  # the file that is damaged, where it is not the one that is opened
    unpack: Pack | None = None  # what is packed in the file can be damaged before it is packed
    pack: Pack | None = None


def at(name: str, write: Callable[..., Any], *arguments: Any, **options: Any) -> Callable[[Path], Path]:
    """Return a function that writes a file of this name into a folder."""

    def make(folder: Path) -> Path:
        write(folder / name, *arguments, **options)
        return folder / name

    return make


def inside(make: Callable[[Path], Path], **keys: Any) -> Reader:
    """Return a reader of what gzip packs."""
    return Reader(make, partial(read_volume, **keys), None, gzip.decompress, gzip.compress)


def read_volume(path: Path, **keys: Any) -> None:
    """All of it, as `texgs volume` does."""
    prepare(open_source(path, **keys), path.parent / "out.nrrd", nan_value=0.0)


def into(folder: Path, write: Callable[..., Any], tags: dict[str, Any]) -> None:
    folder.mkdir()
    write(folder, tags)


def nibabel_image(path: Path, kind: Any, values: np.ndarray = SHORTS.T) -> None:
    nibabel.save(kind(values, np.diag([2, 3, 4, 1])), path)


def vtk_cells(path: Path) -> None:
    ends = (np.append(place, 2 * place[-1] - place[-2]) for place in PLACES)
    cells(pyvista.RectilinearGrid(*ends)).save(path)


def hyperstack(path: Path, **kind: Any) -> None:
    """Two steps of two channels, twice in one file where it is OME-TIFF."""
    axes, shape = ("TCZYX", (2, 2, 3, 12, 13)) if "ome" in kind else ("TZCYX", (2, 3, 2, 12, 13))
    values = np.concatenate([VALUES[:3]] * 4)
    with tifffile.TiffWriter(path, **kind) as file:
        for _ in range(2 if "ome" in kind else 1):
            file.write(values.reshape(shape), metadata={"axes": axes}, compression="zlib")


def image(version: str, **options: Any) -> Callable[[Path], Path]:
    keys = {"chunks": (6, 6, 7), "version": version, **options}
    return at("v.ome.zarr", write_image, [VALUES], axes_of("zyx"), [(3, 2, 0.5)], **keys)


MAP_ALONG_Z = {"mapc": 3, "mapr": 2, "maps": 1}  # columns; sections are along x
IN_TIME = at("v.nii.gz", nibabel_image, nibabel.Nifti1Image, np.stack([SHORTS.T] * 3, axis=3))
POSITIONS = {"TemporalPositionIdentifier": lambda step, z: step}
PHASES = {"SeriesDescription": lambda step: f"{step}0%"}
ZARR = {
    "zarr 2": ("0.4", {}, "s0/.zarray"),
    "zarr 2 image": ("0.4", {}, ".zattrs"),
    "zarr 3": ("0.5", {}, "s0/zarr.json"),
    "zarr 3 image": ("0.5", {}, "zarr.json"),
    "zarr 3 chunk": ("0.5", {}, "s0/c/0/0/0"),
    "zarr 3 shard": ("0.5", {"shards": (12, 12, 14)}, "s0/c/0/0/0"),
    "zarr blosc": ("0.5", {"compressors": BLOSC}, "s0/c/0/0/0"),
}
# By names: what writes a file, and the keys by which it is read.
FILES: dict[str, tuple[Callable[[Path], Path], dict[str, Any]]] = {
    **{name: (at(name, write, VALUES), {}) for name, write in WRITERS.items()},
    **{name: (at(name, write_slc, VALUES), {}) for name in ("plain.slc", "packed.slc")},
    "dicom frames samples": (
        at("v.dcm", write_enhanced, VALUES[:5], [frame(z, 1 + z) for z in range(5)]),
        {},
    ),
    **{name: (at(name, write_map, SHORTS, **MAP_ALONG_Z), {}) for name in ("v.map", "v.map.gz")},
    "mgz": (at("v.mgz", nibabel_image, nibabel.MGHImage), {}),
    "analyze": (at("v.hdr", nibabel_image, nibabel.AnalyzeImage), {}),
    "npz": (at("v.npz", np.savez_compressed, a=VALUES, b=VALUES + 1), {"variable": "b"}),
    "layers of.nrrd": (at("v.seg.nrrd", write_nrrd, 0, "list", "gzip"), {"channel": "1"}),
    "steps of.mha": (
        at("v.mha", lambda path: WriteImage(GetImageFromArray(STEPS, False), path)),
        {"time": 1},
    ),
    **{f"cells.{kind}": (at(f"v.{kind}", vtk_cells), {}) for kind in ("vtr", "vtk")},
    "pieces.pvti": (at("v.pvti", write_pieces), {}),
    "netcdf": (at("v.nc", write_netcdf, {"t": FIELD}), {}),
    "hdf5": (at("v.h5", write_labelled), {}),
    "hdf5 packed": (at("v.h5", write_labelled, chunks=(3, 4, 5), compression="gzip", fletcher32=True), {}),
    "zarr zip": (lambda folder: zipped(image("0.5")(folder), folder / "v"), {}),
    **{
        name: (at(name, write_lines, LINES), {"dims": (6, 5, 4), "column": 2})
        for name in ("v.txt", "v.txt.gz")
    },
    "ome": (at("v.tif", hyperstack, ome=True), {"image": "1", "channel": "1", "time": 1}),
    "imagej": (at("v.tif", hyperstack, imagej=True), {"channel": "0", "time": 1}),
}
VOLUMES: dict[str, Reader] = {
    **{name: Reader(make, partial(read_volume, **keys)) for name, (make, keys) in FILES.items()},
    "plain.mhd samples": Reader(FILES["compressed.mhd"][0], read_volume, "compressed.zraw"),
    "slices": Reader(at("v", folder_of, dict(zip("012", A, strict=False))), read_volume, "v/0.tif"),
    "dicom samples": Reader(
        at("slices", into, write_steps, POSITIONS), partial(read_volume, time=1), "slices/29-1.ima"
    ),
    "dicom phases samples": Reader(
        at("slices", into, write_phases, PHASES),
        partial(read_volume, series="all", time=1),
        "slices/00-6.ima",
    ),
    "nii.gz inside": inside(FILES["packed.nii.gz"][0]),
    "nii time inside": inside(IN_TIME, time=1),
    "map inside": inside(FILES["v.map.gz"][0]),
    "mgz inside": inside(FILES["mgz"][0]),
    **{
        name: Reader(image(version, **options), read_volume, f"v.ome.zarr/{victim}")
        for name, (version, options, victim) in ZARR.items()
    },
}
