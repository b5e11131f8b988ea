"""Every reader of files that others have made, with a small whole file of its kind to damage."""

from __future__ import annotations

import lzma
import os
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from PIL import Image

from tests.config.kept import project
from tests.fields.gaussians.samples import sample as gaussians
from tests.fields.palette.test_palette import box
from tests.fields.surfels.samples import sample
from tests.fields.surfels.test_release_texture import release_run
from tests.fuzz.labels import LABELS
from tests.fuzz.volumes import VOLUMES, Reader, at
from tests.study.test_ballots import STUDY, ballot
from tests.volume.test_tf_files import RAMP, TENT, preset
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
from texgs.scene.keyframes import read_keys
from texgs.scene.scene import Scene, SceneModel, SceneSegment, SceneVolume
from texgs.scene.scene_file import read_scene, write_scene
from texgs.scene.segment_file import read_segment, write_segment
from texgs.scene.series_file import Series, read_series, write_series
from texgs.scene.shot import Shot
from texgs.scene.twin import Twin
from texgs.study.ballots import read_ballot
from texgs.study.questions import read_key, write_key
from texgs.volume.generate import sphere
from texgs.volume.prepare import prepare_channels
from texgs.volume.slabs import ArraySource
from texgs.volume.tf_files import read_tf
from texgs.volume.transfer import TransferFunction
from texgs.volume.view_set import View, read_views, write_transforms

PICTURES = ("png", "jpg", "gif", "webp")
RISE = TransferFunction(((0.1, 0.2), (0.3, 0.9)), ((0.1, 0.5, 0.4, 0.3),))
FALL = TransferFunction(((0.3, 0.5), (0.3, 0.4), (0.9, 0)), ((0.3, 1, 0.4, 0.3), (0.9, 0, 0, 1)))
TF_OURS = {"format": "texgs-tf", "version": 1, **TENT.to_dict()}


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
    light, functions = Light("directional", 30, 20, 0.7, 0.5, 0.3), {"TF02": RISE, "TF03": FALL}
    whole = Scene(models, light, volume=volume, frame=frame, functions=functions)
    return write_scene(folder / "scene.yaml", whole)


def read_whole_scene(path: Path) -> None:
    opened = read_scene(path)
    Twin(opened).render(orbit(40, 10, 4, 30, 4, 4), opened, opened.open().palettes)
    write_scene(path.with_name("again.yaml"), opened)


def picture(path: Path, **options: Any) -> None:
    pixels = np.random.default_rng(0).integers(0, 255, (48, 40, 3), np.uint8)
    Image.fromarray(pixels).save(path, **options)


def weights(path: Path, is_new: bool) -> None:
    tensors = {"a.weight": torch.rand(4, 3), "b.bias": torch.arange(5)}
    torch.save(tensors, path, _use_new_zipfile_serialization=is_new)


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


KEYS = [{"azimuth": -60, "cut": "x,0.2", "seconds": 1.5}, {"TF01.opacity": 0.2, "target": [0, 0, 1]}, {}]
COMPACT = at("model.texgs", write_compact, sample())
READERS: dict[str, Reader] = {
    **VOLUMES,
    **LABELS,
    "tf ours": Reader(at("tf.json", write_json, TF_OURS), read_function),
    "tf ParaView": Reader(lambda folder: preset(folder, ColorSpace="Diverging", Points=RAMP), read_function),
    "views json": Reader(views, read_view_set, "transforms_train.json"),
    "views png": Reader(views, read_view_set, "r_1.png"),
    "model": Reader(at("model.safetensors", write_model, sample()), read_model),
    "compact": Reader(COMPACT, open_model),
    "compact inside": Reader(COMPACT, open_model, None, unpacked_compact, packed_compact),
    "gaussians": Reader(at("g", write_gaussians, gaussians()), read_gaussians),
    "gaussians.ply": Reader(at("g.ply", write_gaussian_ply, gaussians()), read_gaussian_ply),
    "palette": Reader(at("p", write_palette, box()), read_palette),
    "texture": Reader(at("t", write_texture, sample()), partial(with_texture, sample())),
    "series": Reader(
        lambda folder: write_series(Series(folder / "series.json", ["a.nrrd", "b.nrrd"], ["TF01"])),
        read_series,
    ),
    "step": Reader(at("s", write_step, sample(), sample(seed=1), {}), partial(at_step, sample())),
    "segment": Reader(
        at("s", write_segment, sample(), torch.arange(7) < 3), lambda path: read_segment(path, sample())
    ),
    "scene": Reader(scene, read_whole_scene),
    "scene of channels": Reader(partial(scene, channel=1), read_whole_scene),
    "keys": Reader(at("keys.yaml", write_json, KEYS), lambda path: read_keys(str(path), Shot(), 25.0)),
    "volume of channels": Reader(partial(scene, channel=1), read_whole_scene, victim="volume.nrrd"),
    "data set": Reader(data_set, keep_function),
    "data set's metrics": Reader(data_set, keep_function, "results/mine/volume/metrics.json"),
    "2dgs.ply": Reader(partial(ply, "2dgs", False), read_ply),
    "3dgs.ply text": Reader(partial(ply, "3dgs", True), read_ply),
    "release.ply": Reader(partial(ply, "release", False), read_ply),
    "release texture": Reader(lambda folder: release_run(folder)[0], read_ply, "texture.npz"),
    "release palette": Reader(lambda folder: release_run(folder)[0], read_ply, "palette_colors_chkpnt.pth"),
    "weights": Reader(at("w.pth", weights, True), read_tensors),
    "weights old": Reader(at("w.pth", weights, False), read_tensors),
    **{f"style.{kind}": Reader(at(f"s.{kind}", picture), read_style) for kind in PICTURES},
    "style.tif": Reader(at("s.tif", picture, compression="tiff_lzw"), read_style),
    "checkpoint": Reader(checkpoint, latest, "checkpoint.safetensors"),
    "json": Reader(at("m", write_json, {"a": [1, 2.5, None], "b": {"c": 0}}), read_json),
    "ballot": Reader(ballot, lambda path: read_ballot(STUDY, path)),
    "study key": Reader(at("key.json", write_key, STUDY), read_key),
}
