"""Folders of views in the Blender layout: images with their cameras and lights, a training and a test set.

Files have OpenGL camera-to-world matrices, and one lens for all frames.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import atan, pi, tan
from pathlib import Path
from typing import Any, Literal

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError, errors_at
from texgs.core.image import open_picture, read_rgba
from texgs.core.io import read_json, reading_as, write_json
from texgs.core.light import HEADLIGHT, Light
from texgs.core.names import is_number, named_file

Split = Literal["train", "test", "relit"]
LENS_KEYS = ("camera_angle_x", "w", "h", "fl_x", "fl_y", "cx", "cy")
OPENCV_FROM_OPENGL = torch.diag(torch.tensor([1.0, -1.0, -1.0, 1.0], dtype=torch.float64))  # its own inverse
RIGID_TOLERANCE = 1e-4  # entries of R^T R may differ from the identity by this much


@dataclass(frozen=True, eq=False)
class View:
    """One image, and the camera and the light it was made with."""

    camera: Camera
    path: Path  # of the PNG file
    light: Light

    def load(self) -> Tensor:
        """Return the pixels as stored: [H, W, 4] uint8, straight alpha."""
        return torch.from_numpy(read_rgba(self.path))


@dataclass(frozen=True, eq=False)
class ViewSet:
    """All views of one scene."""

    folder: Path
    train: list[View]
    test: list[View]  # empty without transforms_test.json
    metadata: dict[str, Any]  # further facts of transforms_train.json: volume, tf, aabb ...
    relit: list[View] = field(default_factory=list)  # more test views, under other lights; of a volume alone


def read_views(folder: str | Path) -> ViewSet:
    """Read a folder of views: all of the JSON files, and of the images the sizes.

    Without `w` and `h` the size is that of the first image; a frame without `light` has a headlight. So the
    sets published with the paper load as they are.
    """
    folder = Path(folder)
    if not (folder / "transforms_train.json").is_file():
        raise ArgumentError(f"{folder}: expected a folder of views, found no transforms_train.json in it")
    train, metadata = _read_split(folder / "transforms_train.json")
    files = [folder / f"transforms_{split}.json" for split in ("test", "relit")]
    test, relit = (_read_split(file)[0] if file.is_file() else [] for file in files)
    return ViewSet(folder, train, test, metadata, relit)


def write_transforms(folder: Path, split: Split, views: Sequence[View], metadata: Mapping[str, Any]) -> Path:
    """Write the transforms_*.json of a split for PNG files in `folder`; they may come later.

    All views have one size and lens; `metadata` are further keys, such as volume, tf, aabb and shading.
    """
    frames = [_frame(folder, view) for view in views]
    width, height = views[0].camera.width, views[0].camera.height
    (fl_x, _, cx), (_, fl_y, cy), _ = views[0].camera.K.tolist()
    lens = (2 * atan(0.5 * width / fl_x), width, height, fl_x, fl_y, cx, cy)
    values = {**dict(zip(LENS_KEYS, lens, strict=True)), **metadata, "frames": frames}
    return write_json(folder / f"transforms_{split}.json", values)


def _frame(folder: Path, view: View) -> dict[str, Any]:
    """Return one entry of the list of frames."""
    light: dict[str, Any] = {"kind": view.light.kind}
    if view.light.kind == "directional":
        light |= {"azimuth": view.light.azimuth, "polar": view.light.polar}
    return {
        "file_path": f"./{view.path.relative_to(folder).with_suffix('').as_posix()}",
        "transform_matrix": camera_to_world(view.camera.viewmat).tolist(),
        "light": light,
    }


def _read_split(path: Path) -> tuple[list[View], dict[str, Any]]:
    """Read views and metadata of one transforms_*.json."""
    with reading_as("cameras of views", where=f"{path}: "):
        values = read_json(path)
        frames = values.pop("frames", None) if isinstance(values, dict) else None
        if not isinstance(frames, list) or not frames or not all(isinstance(frame, dict) for frame in frames):
            raise ArgumentError(f"{path}: expected an object with a list of frames, at least one; found none")
        images = [_image_path(path, index, frame) for index, frame in enumerate(frames)]
        if missing := [image for image in images if not image.is_file()]:
            raise ArgumentError(
                f"{missing[0]}: no such image; {len(missing)} of {len(images)} in {path.name} are missing"
            )
        width, height = _size(path, values, images)
        K = _lens_matrix(str(path), values, width, height)
        views = []
        for index, (frame, image) in enumerate(zip(frames, images, strict=True)):
            where = f"{path}: frame {index} ({image.stem})"
            viewmat = world_to_camera(where, frame.get("transform_matrix"))
            views.append(View(Camera(viewmat.float(), K, width, height), image, _light(where, frame)))
        return views, {key: value for key, value in values.items() if key not in LENS_KEYS}


def _image_path(path: Path, index: int, frame: Mapping[str, Any]) -> Path:
    """Return the image of a frame; the layout leaves out the extension."""
    image = named_file(f"{path}: frame {index}: file_path", path.parent, frame.get("file_path"), "an image")
    return image if image.suffix == ".png" else image.with_name(f"{image.name}.png")


def _size(path: Path, values: Mapping[str, Any], images: Sequence[Path]) -> tuple[int, int]:
    """Return width and height from the file, or of its first image; all images share them."""
    sizes = []
    for image in images:
        with open_picture(image) as picture:
            sizes.append(picture.size)
    stated = ("w" in values or "h" in values) and tuple(_number(str(path), values, key) for key in ("w", "h"))
    size = stated or sizes[0]
    for image, actual in zip(images, sizes, strict=True):
        if actual != size:
            source = "w and h say" if stated else f"{images[0].name} has"
            raise ArgumentError(
                f"{image}: expected {size[0]} x {size[1]} pixels as {source}, got {actual[0]} x {actual[1]}"
            )
    return sizes[0]


def _light(where: str, frame: Mapping[str, Any]) -> Light:
    """Return the light of a frame."""
    light = frame.get("light", {"kind": "headlight"})
    if not isinstance(light, dict) or light.get("kind") not in ("headlight", "directional"):
        raise ArgumentError(f"{where}: light: expected the kind headlight or directional, got {light!r}")
    if light["kind"] == "headlight":
        return HEADLIGHT
    with errors_at(f"{where}: light"):
        return Light("directional", _number(where, light, "azimuth"), _number(where, light, "polar"))


def camera_to_world(viewmat: Tensor) -> Tensor:
    """Return the camera-to-world matrix [4, 4] with OpenGL axes (y up, z back), float64."""
    return torch.linalg.inv(viewmat.double()) @ OPENCV_FROM_OPENGL.to(viewmat.device)


def world_to_camera(where: str, matrix: Any) -> Tensor:
    """Return the world-to-camera matrix [4, 4] with OpenCV axes, float64, of a frame's `transform_matrix`.

    The last row is taken as 0 0 0 1.
    """
    try:
        rigid = torch.tensor(matrix, dtype=torch.float64)
    except (TypeError, ValueError, RuntimeError) as error:
        raise ArgumentError(f"{where}: transform_matrix: expected four rows of four numbers") from error
    if rigid.shape != (4, 4):
        raise ArgumentError(f"{where}: transform_matrix: expected [4, 4] numbers, got {list(rigid.shape)}")
    rigid[3] = torch.tensor([0.0, 0.0, 0.0, 1.0])
    R_wc = rigid[:3, :3]
    defect = float((R_wc.T @ R_wc - torch.eye(3, dtype=torch.float64)).abs().max())
    # Written so that NaN is refused as well.
    if not (defect < RIGID_TOLERANCE and bool(rigid.isfinite().all()) and float(torch.linalg.det(R_wc)) > 0):
        raise ArgumentError(
            f"{where}: transform_matrix: expected a rotation and a position, got a matrix that is singular, "
            "scaled, mirrored or not finite"
        )
    return torch.linalg.inv(rigid @ OPENCV_FROM_OPENGL)


def _lens_matrix(where: str, values: Mapping[str, Any], width: int, height: int) -> Tensor:
    """Return K [3, 3], float32, from the top level of the file.

    Focal lengths default to `camera_angle_x` (horizontal, radians) and square pixels, the principal point
    to the middle.
    """
    if "fl_x" in values:
        focal_x = _number(where, values, "fl_x")
    else:
        angle = _number(where, values, "camera_angle_x")
        if not 0 < angle < pi:
            raise ArgumentError(f"{where}: camera_angle_x: expected radians between 0 and pi, got {angle}")
        focal_x = 0.5 * width / tan(0.5 * angle)
    focal_y = _number(where, values, "fl_y", focal_x)
    if not min(focal_x, focal_y) > 0:
        raise ArgumentError(f"{where}: expected focal lengths above 0, got {focal_x} and {focal_y}")
    cx, cy = _number(where, values, "cx", 0.5 * width), _number(where, values, "cy", 0.5 * height)
    return torch.tensor([[focal_x, 0.0, cx], [0.0, focal_y, cy], [0.0, 0.0, 1.0]])


def _number(where: str, values: Mapping[str, Any], key: str, default: float | None = None) -> float:
    """Return the finite number at `key`."""
    value = values.get(key, default)
    if value is None:
        raise ArgumentError(f"{where}: expected the key {key}, found {', '.join(values) or 'no keys'}")
    if not is_number(value):
        raise ArgumentError(f"{where}: {key}: expected a finite number, got {value!r:.100}")
    return value
