"""Folders of views in the Blender layout: images with their cameras and lights, a training and a test set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.image import open_picture, read_rgba
from texgs.core.io import read_json, reading_as, write_json
from texgs.core.light import Light
from texgs.core.names import named_file
from texgs.volume.transforms import (
    LENS_KEYS,
    camera_to_world,
    lens_matrix,
    lens_values,
    number,
    world_to_camera,
)


@dataclass(frozen=True, eq=False)
class View:
    """One image, and the camera and the light it was made with."""

    camera: Camera
    path: Path  # of the PNG file
    light: Light

    def load(self) -> Tensor:
        """The pixels as stored: [H, W, 4] uint8, straight alpha; see `read_rgba`."""
        return torch.from_numpy(read_rgba(self.path))


@dataclass(frozen=True, eq=False)
class ViewSet:
    """All views of one scene."""

    folder: Path
    train: list[View]
    test: list[View]  # empty where the folder has no transforms_test.json
    metadata: dict[str, Any]  # what transforms_train.json says beside lens and frames: volume, tf, aabb ...


def read_views(folder: str | Path) -> ViewSet:
    """Read a folder of views: all of the two JSON files, and of the images the sizes.

    Without `w` and `h` the size is that of the first image; a frame without `light` has a headlight. So the
    sets published with the paper load as they are.

    Raises:
        ArgumentError: if a file is missing or does not hold what it should, naming file and frame.
    """
    folder = Path(folder)
    if not (folder / "transforms_train.json").is_file():
        raise ArgumentError(
            f"{folder}: expected a folder of views, with a file transforms_train.json; found none there"
        )
    train, metadata = _read_split(folder / "transforms_train.json")
    test_file = folder / "transforms_test.json"
    test = _read_split(test_file)[0] if test_file.is_file() else []
    return ViewSet(folder, train, test, metadata)


def write_transforms(
    folder: str | Path, split: Literal["train", "test"], views: Sequence[View], metadata: Mapping[str, Any]
) -> Path:
    """Write transforms_train.json or transforms_test.json for images in `folder`; they may come later.

    Args:
        folder: of the view set.
        split: which of the two files.
        views: at least one; all of one size and lens.
        metadata: further keys of the top level, such as volume, tf, aabb and shading.

    Returns:
        Path of the file.

    Raises:
        ArgumentError: if views differ in size or lens, an image is no PNG file in `folder`, or `metadata`
            has a key of the layout.
    """
    folder = Path(folder)
    path = folder / f"transforms_{split}.json"
    if not views:
        raise ArgumentError(f"{path}: expected at least one view, got none")
    if taken := [key for key in (*LENS_KEYS, "frames") if key in metadata]:
        raise ArgumentError(
            f"metadata: {', '.join(taken)} would overwrite what the views say; choose other keys"
        )
    lens = lens_values(views[0].camera)
    if other := next((view for view in views if lens_values(view.camera) != lens), None):
        raise ArgumentError(
            f"{other.path}: expected the size and lens of {views[0].path}; other lenses need another folder"
        )
    frames = [_frame(folder, view) for view in views]
    return write_json(path, {**lens, **metadata, "frames": frames})


def _frame(folder: Path, view: View) -> dict[str, Any]:
    """One entry of the list of frames."""
    if not view.path.is_relative_to(folder) or view.path.suffix != ".png":
        raise ArgumentError(f"{view.path}: expected a .png file in {folder}")
    light: dict[str, Any] = {"kind": view.light.kind}
    if view.light.kind == "directional":
        light |= {"azimuth": view.light.azimuth, "polar": view.light.polar}
    return {
        "file_path": f"./{view.path.relative_to(folder).with_suffix('').as_posix()}",
        "transform_matrix": camera_to_world(view.camera.viewmat).tolist(),
        "light": light,
    }


def _read_split(path: Path) -> tuple[list[View], dict[str, Any]]:
    """Views and metadata of one transforms_*.json."""
    with reading_as("cameras of views", where=f"{path}: "):
        return _split_of(path, read_json(path))


def _split_of(path: Path, values: Any) -> tuple[list[View], dict[str, Any]]:
    """The same, from the values of the file."""
    frames = values.pop("frames", None) if isinstance(values, dict) else None
    if not isinstance(frames, list) or not frames or not all(isinstance(frame, dict) for frame in frames):
        raise ArgumentError(f"{path}: expected an object with a list of frames, at least one; found none")
    images = [_image_path(path, index, frame) for index, frame in enumerate(frames)]
    if missing := [image for image in images if not image.is_file()]:
        raise ArgumentError(
            f"{missing[0]}: no such image, of {len(missing)} missing of the {len(images)} in {path.name}; "
            "copy them there"
        )
    width, height = _size(path, values, images)
    K = lens_matrix(str(path), values, width, height)
    views = []
    for index, (frame, image) in enumerate(zip(frames, images, strict=True)):
        where = f"{path}: frame {index} ({image.stem})"
        viewmat = world_to_camera(where, frame.get("transform_matrix"))
        views.append(View(Camera(viewmat.float(), K, width, height), image, _light(where, frame)))
    return views, {key: value for key, value in values.items() if key not in LENS_KEYS}


def _image_path(path: Path, index: int, frame: Mapping[str, Any]) -> Path:
    """Image of a frame; the layout leaves out the extension."""
    image = named_file(f"{path}: frame {index}: file_path", path.parent, frame.get("file_path"), "an image")
    return image if image.suffix == ".png" else image.with_name(f"{image.name}.png")


def _size(path: Path, values: Mapping[str, Any], images: Sequence[Path]) -> tuple[int, int]:
    """Width and height that the file states, or of its first image; all images have it."""
    sizes = [_png_size(image) for image in images]
    stated = ("w" in values or "h" in values) and tuple(number(str(path), values, key) for key in ("w", "h"))
    size = stated or sizes[0]
    for image, actual in zip(images, sizes, strict=True):
        if actual != size:
            source = "w and h say" if stated else f"{images[0].name} has"
            raise ArgumentError(
                f"{image}: expected {size[0]} x {size[1]} pixels as {source}, got {actual[0]} x {actual[1]}"
            )
    return sizes[0]


def _png_size(image: Path) -> tuple[int, int]:
    """Width and height from the file's header."""
    with open_picture(image) as picture:
        return picture.size


def _light(where: str, frame: Mapping[str, Any]) -> Light:
    """Light of a frame."""
    light = frame.get("light", {"kind": "headlight"})
    if not isinstance(light, dict) or light.get("kind") not in ("headlight", "directional"):
        raise ArgumentError(f"{where}: light: expected the kind headlight or directional, got {light!r}")
    if light["kind"] == "headlight":
        return Light("headlight")
    return Light("directional", number(where, light, "azimuth"), number(where, light, "polar"))
