"""Every reader of files that others have made, with a small whole file of its kind to damage."""

from __future__ import annotations

import gzip
import lzma
import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import nibabel
import numpy as np
import pyvista
import SimpleITK
import tifffile
import torch
from PIL import Image
from pydicom.uid import generate_uid
from vtkmodules.vtkIOParallelXML import vtkXMLPImageDataWriter
from zarr.codecs import BloscCodec

from tests.config.kept import project
from tests.fields.gaussians.samples import sample as gaussians
from tests.fields.palette.test_palette import box
from tests.fields.surfels.samples import sample
from tests.fields.surfels.test_release_texture import release_run
from tests.study.test_ballots import STUDY, ballot
from tests.volume.dicom_files import frame, write_enhanced
from tests.volume.dicom_files import write_series as write_slices
from tests.volume.test_extra_axis import VALUES as STEPS
from tests.volume.test_extra_axis import write_nrrd
from tests.volume.test_mrc import write as write_map
from tests.volume.test_netcdf import FIELD, write_netcdf
from tests.volume.test_text_columns import LINES, write_lines
from tests.volume.test_tf_files import RAMP, TENT, preset
from tests.volume.volume_files import WRITERS, image_data, sample_values
from tests.volume.zarr_files import axes_of, write_image, zipped
from texgs.config.kept_function import keep
from texgs.core.camera import orbit
from texgs.core.io import read_json, write_json
from texgs.core.lens import Frame
from texgs.core.light import Light
from texgs.edit.style_picture import read_style
from texgs.fields.gaussians import read_gaussians, write_gaussians
from texgs.fields.gaussians import read_ply as read_gaussian_ply
from texgs.fields.gaussians import write_ply as write_gaussian_ply
from texgs.fields.palette.model import read_palette, write_palette
from texgs.fields.surfels.compact import open_model, write_compact
from texgs.fields.surfels.model_file import read_model, write_model
from texgs.fields.surfels.ply import read_ply, write_ply
from texgs.fields.surfels.step_file import at_step, write_step
from texgs.fields.surfels.variants import with_texture, write_texture
from texgs.fitting.checkpoint import latest
from texgs.models.networks import read_tensors
from texgs.scene.scene import Scene, SceneModel, SceneSegment, SceneVolume
from texgs.scene.scene_file import read_scene, write_scene
from texgs.scene.segment_file import read_segment, write_segment
from texgs.scene.series_file import Series, read_series, write_series
from texgs.scene.twin import Twin
from texgs.study.ballots import read_ballot
from texgs.study.questions import read_key, write_key
from texgs.volume.generate import sphere
from texgs.volume.prepare import prepare, prepare_channels
from texgs.volume.slabs import ArraySource
from texgs.volume.sources import open_source
from texgs.volume.tf_files import read_tf
from texgs.volume.transfer import TransferFunction
from texgs.volume.view_set import View, read_views, write_transforms

BLOSC = BloscCodec()
PICTURES = ("png", "jpg", "gif", "webp")
RISE = TransferFunction(((0.1, 0.2), (0.3, 0.9)), ((0.1, 0.5, 0.4, 0.3),))
FALL = TransferFunction(((0.3, 0.5), (0.3, 0.4), (0.9, 0)), ((0.3, 1, 0.4, 0.3), (0.9, 0, 0, 1)))
Pack = Callable[[bytes], bytes]


@dataclass(frozen=True)
class Reader:
    """One way into the program."""

    make: Callable[[Path], Path]  # writes into a folder; returns the file to open
    read: Callable[[Path], object]  # as the program does it
    victim: str | None = None  # the file that is damaged, where it is not the one that is opened
    unpack: Pack | None = None  # what is packed in the file can be damaged before it is packed
    pack: Pack | None = None


def volume(name: str, folder: Path) -> Path:
    WRITERS[name](folder / name, sample_values())
    return folder / name


def read_volume(path: Path, **keys: Any) -> None:
    """All of it, as `texgs volume` does."""
    prepare(open_source(path, **keys), path.parent / "out.nrrd", nan_value=0.0)


def dicom(folder: Path) -> Path:
    """Two steps of four slices."""
    (folder / "slices").mkdir()
    for step in range(2):
        write_slices(folder / "slices", sample_values()[:4] + step, number=step, AcquisitionNumber=step)
    return folder / "slices"


def dicom_phases(folder: Path) -> Path:
    """Two series of four slices."""
    (folder / "slices").mkdir()
    for step in range(2):
        uid = generate_uid(entropy_srcs=[str(step)])
        write_slices(folder / "slices", sample_values()[:4] + step, number=step, uid=uid)
    return folder / "slices"


def dicom_frames(folder: Path) -> Path:
    """Five frames with a slope each."""
    return write_enhanced(folder / "v.dcm", sample_values()[:5], [frame(z, 1 + z) for z in range(5)])


def map_of_cells(name: str, folder: Path) -> Path:
    """With columns along z, and sections along x."""
    write_map(folder / name, sample_values("int16"), mapc=3, mapr=2, maps=1)
    return folder / name


def mgh(folder: Path) -> Path:
    nibabel.save(nibabel.MGHImage(sample_values("int16").T, np.eye(4)), folder / "v.mgz")
    return folder / "v.mgz"


def pair(folder: Path) -> Path:
    nibabel.save(nibabel.AnalyzeImage(sample_values("int16").T, np.eye(4)), folder / "v.img")
    return folder / "v.hdr"


def archive(folder: Path) -> Path:
    np.savez_compressed(folder / "v.npz", a=sample_values(), b=sample_values() + 1)
    return folder / "v.npz"


def four_axes(name: str, folder: Path) -> Path:
    if name.endswith("nrrd"):
        write_nrrd(folder / name, 0, "list", "gzip")
    else:
        SimpleITK.WriteImage(SimpleITK.GetImageFromArray(STEPS, isVector=False), folder / name)
    return folder / name


def vtk_cells(name: str, folder: Path) -> Path:
    places = [np.arange(size + 1.0) for size in (13, 12, 11)]
    grid = pyvista.RectilinearGrid(*places)
    grid.cell_data["density"] = sample_values().ravel()
    grid.save(folder / name)
    return folder / name


def pieces(folder: Path) -> Path:
    writer = vtkXMLPImageDataWriter()
    writer.SetFileName(str(folder / "v.pvti"))
    writer.SetInputData(image_data(sample_values()))
    writer.SetNumberOfPieces(2)
    writer.SetEndPiece(1)
    writer.Write()
    return folder / "v.pvti"


def nifti_in_time(folder: Path) -> Path:
    steps = np.stack([sample_values("int16").T] * 3, axis=3)
    nibabel.save(nibabel.Nifti1Image(steps, np.diag([2, 3, 4, 1])), folder / "v.nii.gz")
    return folder / "v.nii.gz"


def slc(compression: int, folder: Path) -> Path:
    values = sample_values("uint8")
    text = f"11111 13 12 11 8 1.0 1.0 2.0 1 0 0 {compression} 2 2 X".encode() + bytes(12)
    for plane in values:
        runs = b"".join(bytes([0x80 | len(row)]) + row.tobytes() for row in plane) + b"\x00"
        text += f"{len(runs)} X".encode() + runs if compression else plane.tobytes()
    (folder / "v.slc").write_bytes(text)
    return folder / "v.slc"


def hdf5(folder: Path, **options: Any) -> Path:
    with h5py.File(folder / "v.h5", "w") as file:
        array = file.create_dataset("a/density", data=FIELD, **options)
        for axis, name in enumerate("zyx"):
            scale = file.create_dataset(name, data=np.arange(FIELD.shape[axis]) * 0.5)
            scale.make_scale(name)
            array.dims[axis].attach_scale(scale)
    return folder / "v.h5"


def image(version: str, folder: Path, **options: Any) -> Path:
    keys = {"chunks": (6, 6, 7), **options}
    return write_image(
        folder / "v.ome.zarr", [sample_values()], axes_of("zyx"), [(3, 2, 0.5)], version=version, **keys
    )


def text(name: str, folder: Path) -> Path:
    return write_lines(folder / name, LINES)


def slices(folder: Path) -> Path:
    (folder / "slices").mkdir()
    for index, plane in enumerate(sample_values()[:3]):
        WRITERS["packed.tif"](folder / "packed.tif", plane)
        (folder / "packed.tif").rename(folder / "slices" / f"{index}.tif")
    return folder / "slices"


def hyperstack(folder: Path, **kind: Any) -> Path:
    """Two steps of two channels, twice in one file where it is OME-TIFF."""
    axes, shape = ("TCZYX", (2, 2, 3, 12, 13)) if "ome" in kind else ("TZCYX", (2, 3, 2, 12, 13))
    values = np.concatenate([sample_values()[:3]] * 4)
    with tifffile.TiffWriter(folder / "v.tif", **kind) as file:
        for _ in range(2 if "ome" in kind else 1):
            file.write(values.reshape(shape), metadata={"axes": axes}, compression="zlib")
    return folder / "v.tif"


def tf_ours(folder: Path) -> Path:
    return write_json(folder / "tf.json", {"format": "texgs-tf", "version": 1, **TENT.to_dict()})


def read_function(path: Path) -> None:
    read_tf(path)(np.linspace(0, 99, 50))


def views(folder: Path) -> Path:
    pictures = []
    for index in range(2):
        path = folder / f"r_{index}.png"
        Image.fromarray(np.full((16, 20, 4), 40 * index, np.uint8)).save(path)
        pictures.append(View(orbit(40 * index, 10, 4, 30, 20, 16), path, Light("headlight")))
    write_transforms(folder, "train", pictures, {"volume": "v", "tf": "TF01"})
    return folder


def read_view_set(folder: Path) -> None:
    for view in read_views(folder).train:
        view.load()


def compact(folder: Path) -> Path:
    return write_compact(folder / "model.texgs", sample())


def unpacked_compact(data: bytes) -> bytes:
    line, _, packed = data.partition(b"\n")
    return line + b"\n" + lzma.decompress(packed)


def packed_compact(data: bytes) -> bytes:
    line, _, stored = data.partition(b"\n")
    return line + b"\n" + lzma.compress(stored)


def ply(flavour: str, text: bool, folder: Path) -> Path:
    from plyfile import PlyData

    path = write_ply(folder / "m.ply", sample("shading", material="paper"), flavour)
    if not text:
        return path
    PlyData(PlyData.read(path).elements, text=True).write(folder / "text.ply")
    return folder / "text.ply"


def scene(folder: Path, channel: int = 0) -> Path:
    file = write_model(folder / "model.safetensors", sample())
    mask = write_segment(folder / "s.safetensors", sample(), torch.arange(7) < 3)
    texture = write_texture(folder / "t.safetensors", sample())
    entry = SceneModel(file, texture=texture, segments={"part": SceneSegment(mask)})
    source = ArraySource(sphere(8), "sphere")
    prepare_channels([source] * (1 + channel), folder / "volume.nrrd")
    volume = SceneVolume(folder / "volume.nrrd", {"TF01": RISE, "TF02": replace(FALL, channel=channel)})
    frame = Frame([0.1, 0.0, -0.2], 0.5)
    models = {"TF01": entry, "TF02": SceneModel(file)}
    whole = Scene(models, volume=volume, frame=frame, functions={"TF02": RISE, "TF03": FALL})
    return write_scene(folder / "scene.yaml", whole)


def read_whole_scene(path: Path) -> None:
    opened = read_scene(path)
    Twin(opened).render(orbit(40, 10, 4, 30, 4, 4), opened, opened.open().palettes)
    write_scene(path.with_name("again.yaml"), opened)


def weights(old: bool, folder: Path) -> Path:
    tensors = {"a.weight": torch.rand(4, 3), "b.bias": torch.arange(5)}
    torch.save(tensors, folder / "w.pth", _use_new_zipfile_serialization=not old)
    return folder / "w.pth"


def picture(name: str, folder: Path, **options: Any) -> Path:
    pixels = np.random.default_rng(0).integers(0, 255, (48, 40, 3), np.uint8)
    Image.fromarray(pixels).save(folder / name, **options)
    return folder / name


def data_set(folder: Path) -> Path:
    write_scene(folder / "scene.yaml", project(folder))
    return folder / "conf" / "dataset" / "mine.yaml"


def keep_function(path: Path) -> None:
    """Write it into the file, in the folder of the project; the file is as before when it is read again."""
    os.chdir(path.parents[2])
    before = path.read_bytes()
    try:
        keep(read_scene(path.parents[2] / "scene.yaml"), "TF03")
    finally:
        path.write_bytes(before)


def checkpoint(folder: Path) -> Path:
    from safetensors.torch import save_file

    save_file({"iteration": torch.tensor(3), "means": torch.rand(4, 3)}, folder / "checkpoint.safetensors")
    return folder


READERS: dict[str, Reader] = {
    **{name: Reader(partial(volume, name), read_volume) for name in WRITERS},
    "plain.mhd samples": Reader(partial(volume, "compressed.mhd"), read_volume, "compressed.zraw"),
    "nii.gz inside": Reader(
        partial(volume, "packed.nii.gz"), read_volume, None, gzip.decompress, gzip.compress
    ),
    "nii time inside": Reader(
        nifti_in_time, partial(read_volume, time=1), None, gzip.decompress, gzip.compress
    ),
    "dicom samples": Reader(dicom, partial(read_volume, time=1), "slices/07-1.ima"),
    "dicom phases samples": Reader(
        dicom_phases, partial(read_volume, series="all", time=1), "slices/00-1.ima"
    ),
    "dicom frames samples": Reader(dicom_frames, read_volume),
    **{name: Reader(partial(map_of_cells, name), read_volume) for name in ("v.map", "v.map.gz")},
    "map inside": Reader(
        partial(map_of_cells, "v.map.gz"), read_volume, None, gzip.decompress, gzip.compress
    ),
    "mgz": Reader(mgh, read_volume),
    "mgz inside": Reader(mgh, read_volume, None, gzip.decompress, gzip.compress),
    "analyze": Reader(pair, read_volume),
    "npz": Reader(archive, partial(read_volume, variable="b")),
    "layers of.nrrd": Reader(partial(four_axes, "v.seg.nrrd"), partial(read_volume, channel="1")),
    "steps of.mha": Reader(partial(four_axes, "v.mha"), partial(read_volume, time=1)),
    **{f"cells.{kind}": Reader(partial(vtk_cells, f"v.{kind}"), read_volume) for kind in ("vtr", "vtk")},
    "pieces.pvti": Reader(pieces, read_volume),
    "plain.slc": Reader(partial(slc, 0), read_volume),
    "packed.slc": Reader(partial(slc, 1), read_volume),
    "netcdf": Reader(lambda folder: write_netcdf(folder / "v.nc", {"t": FIELD}), read_volume),
    "hdf5": Reader(hdf5, read_volume),
    "hdf5 packed": Reader(partial(hdf5, chunks=(3, 4, 5), compression="gzip", fletcher32=True), read_volume),
    "zarr 2": Reader(partial(image, "0.4"), read_volume, "v.ome.zarr/s0/.zarray"),
    "zarr 2 image": Reader(partial(image, "0.4"), read_volume, "v.ome.zarr/.zattrs"),
    "zarr 3": Reader(partial(image, "0.5"), read_volume, "v.ome.zarr/s0/zarr.json"),
    "zarr 3 image": Reader(partial(image, "0.5"), read_volume, "v.ome.zarr/zarr.json"),
    "zarr 3 chunk": Reader(partial(image, "0.5"), read_volume, "v.ome.zarr/s0/c/0/0/0"),
    "zarr 3 shard": Reader(partial(image, "0.5", shards=(12, 12, 14)), read_volume, "v.ome.zarr/s0/c/0/0/0"),
    "zarr blosc": Reader(partial(image, "0.5", compressors=BLOSC), read_volume, "v.ome.zarr/s0/c/0/0/0"),
    "zarr zip": Reader(lambda folder: zipped(image("0.5", folder), folder / "v"), read_volume),
    **{
        name: Reader(partial(text, name), partial(read_volume, dims=(6, 5, 4), column=2))
        for name in ("v.txt", "v.txt.gz")
    },
    "slices": Reader(slices, read_volume, "slices/0.tif"),
    "ome": Reader(partial(hyperstack, ome=True), partial(read_volume, image="1", channel="1", time=1)),
    "imagej": Reader(partial(hyperstack, imagej=True), partial(read_volume, channel="0", time=1)),
    "tf ours": Reader(tf_ours, read_function),
    "tf ParaView": Reader(lambda folder: preset(folder, ColorSpace="Diverging", Points=RAMP), read_function),
    "views json": Reader(views, read_view_set, "transforms_train.json"),
    "views png": Reader(views, read_view_set, "r_1.png"),
    "model": Reader(lambda folder: write_model(folder / "model.safetensors", sample()), read_model),
    "compact": Reader(compact, open_model),
    "compact inside": Reader(compact, open_model, None, unpacked_compact, packed_compact),
    "gaussians": Reader(lambda folder: write_gaussians(folder / "g", gaussians()), read_gaussians),
    "gaussians.ply": Reader(
        lambda folder: write_gaussian_ply(folder / "g.ply", gaussians()), read_gaussian_ply
    ),
    "palette": Reader(lambda folder: write_palette(folder / "p", box()), read_palette),
    "texture": Reader(
        lambda folder: write_texture(folder / "t", sample()), lambda path: with_texture(sample(), path)
    ),
    "series": Reader(
        lambda folder: write_series(Series(folder / "series.json", ["a.nrrd", "b.nrrd"], ["TF01"])),
        read_series,
    ),
    "step": Reader(
        lambda folder: write_step(folder / "s", sample(), sample(seed=1), {}),
        lambda path: at_step(sample(), path),
    ),
    "segment": Reader(
        lambda folder: write_segment(folder / "s", sample(), torch.arange(7) < 3),
        lambda path: read_segment(path, sample()),
    ),
    "scene": Reader(scene, read_whole_scene),
    "scene of channels": Reader(partial(scene, channel=1), read_whole_scene),
    "volume of channels": Reader(partial(scene, channel=1), read_whole_scene, victim="volume.nrrd"),
    "data set": Reader(data_set, keep_function),
    "data set's metrics": Reader(data_set, keep_function, "results/mine/volume/metrics.json"),
    "2dgs.ply": Reader(partial(ply, "2dgs", False), read_ply),
    "3dgs.ply text": Reader(partial(ply, "3dgs", True), read_ply),
    "release.ply": Reader(partial(ply, "release", False), read_ply),
    "release texture": Reader(lambda folder: release_run(folder)[0], read_ply, "texture.npz"),
    "release palette": Reader(lambda folder: release_run(folder)[0], read_ply, "palette_colors_chkpnt.pth"),
    "weights": Reader(partial(weights, False), read_tensors),
    "weights old": Reader(partial(weights, True), read_tensors),
    **{f"style.{kind}": Reader(partial(picture, f"s.{kind}"), read_style) for kind in PICTURES},
    "style.tif": Reader(partial(picture, "s.tif", compression="tiff_lzw"), read_style),
    "checkpoint": Reader(checkpoint, latest, "checkpoint.safetensors"),
    "json": Reader(lambda folder: write_json(folder / "m", {"a": [1, 2.5, None], "b": {"c": 0}}), read_json),
    "ballot": Reader(ballot, lambda path: read_ballot(STUDY, path)),
    "study key": Reader(lambda folder: write_key(folder / "key.json", STUDY), read_key),
}
