"""Volume rendering by the native libraries: rays through the samples as they are stored.

Values are trilinear, in single precision; colours and opacities are exact between the points of a transfer
function and at them. Gradients are central differences, one voxel to both sides. Lights and viewer are
distant: the directions to them are the same for all points of one view. Nothing of the volume is copied on a
CPU: bricks of 4 x 4 x 4 cells are known by their extremes, and rays leap over those in which nothing shows;
in others, cells in which nothing shows are passed by.

The result has the same bits for any number of threads.
"""

import warnings
from collections.abc import Collection, Sequence
from copy import copy
from ctypes import c_int32, c_int64
from dataclasses import dataclass
from functools import reduce
from math import hypot, inf
from typing import Any, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from texgs.core import check
from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.light import Light
from texgs.core.memory import require_memory
from texgs.raster import native
from texgs.raster.api import CutRange
from texgs.raster.arguments import pinhole, require
from texgs.volume.grid import Grid
from texgs.volume.label_masks import HALF
from texgs.volume.light_cells import LightCells
from texgs.volume.render import Appearance, directions
from texgs.volume.transfer import TransferFunction, left_limit, right_limit

TYPES = ("uint8", "int8", "uint16", "int16", "uint32", "int32", "uint64", "int64", "float32", "float64")
OUTPUTS = ("depth", "median", "normal")
BYTES_PER_PIXEL = 64  # of memory for a pixel
CACHE_SIZE = 2  # prepared sets of functions; compared pictures take turns
MIN_WIDTH = torch.finfo(torch.float32).tiny  # least width of a transfer function, in data values
MAX_SAMPLES = 2**24  # samples along a ray; float32 counts them
Prepared = tuple[Any, Any, Any]  # functions and by_cell, the arguments of the library, what these need
PADDING = 3  # bytes after the distances of bricks, which are loaded as words
NativeVolume = native.struct("texgs_volume", "p values, i type, 3i size, 3f half")
NativeTransfer = native.struct("texgs_transfer", "i n, p points within")
NativeView = native.struct(
    "texgs_cast_view",
    "p viewmat K, i width height, f step opacity_unit, 3f to_viewer to_light, "
    "f ambient diffuse specular shininess, p rgba depth median normal, "
    "p depth_range face planes, i n_planes unlit_faces, "
    "p light, 3i light_size, 3f light_half, f shadows occlusion outset",
)
native.declare("texgs_volume_bricks", NativeVolume, "p", result=c_int64, stream=False)
native.declare("texgs_volume_extremes", NativeVolume, "pp")
native.declare("texgs_volume_distance", NativeVolume, "p", NativeTransfer, "p")
native.declare("texgs_volume_cells", NativeVolume, "p", NativeTransfer, "p")
native.declare("texgs_cast", NativeVolume, NativeTransfer, "ippp", NativeView)


@dataclass(frozen=True, eq=False)
class Cast:
    """What rays see; float32."""

    rgba: Tensor  # [H, W, 4] premultiplied
    depth: Tensor | None = None  # [H, W] mean camera z, weighted like colours; 0 where alpha is 0
    median: Tensor | None = None  # [H, W] camera z at half of the light, or 0
    normal: Tensor | None = None  # [H, W, 3] mean normal, against the ray, world axes; length at most 1


class Caster:
    """Renders one volume from any camera; samples of what is shown go to the device that casts rays.

    Samples in C order and native bytes are not copied on a CPU. NaN is transparent, with the cells around it.
    """

    local_viewer = False

    def __init__(self, grid: Grid, appearance: Appearance, device: torch.device | str = "cpu") -> None:
        self._appearance, self._grid = appearance, grid
        self.half = [float(side) for side in grid.aabb[1]]  # half the sides of its box, world units
        self._diagonal = 2 * hypot(*self.half)
        self._voxel = min(2 * side / (size - 1) for side, size in zip(self.half, grid.dims, strict=True))
        # With the number of the GPU, whichever is the current one later.
        self.device = torch.empty(0, device=device).device
        self._channels = dict[int, tuple[native.Struct, Tensor]]()  # that were shown, of all copies
        self._prepared = list[Prepared]()  # the last CACHE_SIZE, of all copies
        if not grid.others:
            self.channel(0)

    def with_appearance(self, appearance: Appearance) -> Self:
        """Return a caster of the same volume with another shading and sampling; nothing is read again."""
        other = copy(self)
        other._appearance = appearance
        return other

    def render(self, tf: TransferFunction, camera: Camera, light: Light) -> NDArray[np.float32]:
        """Return premultiplied RGBA [H, W, 4] in [0, 1], from a transfer function in data values."""
        return self.cast(tf, camera, light).rgba.cpu().numpy()

    def cast(
        self,
        tf: TransferFunction | Sequence[TransferFunction],
        camera: Camera,
        light: Light,
        outputs: Collection[str] = (),
        *,
        depth_range: Tensor | None = None,  # [2, H, W] camera z
        faces: CutRange | None = None,
        lit_faces: bool = True,
        by_cell: bool = True,
        cells: LightCells | None = None,
    ) -> Cast:
        """Cast a view, with what else is wanted of OUTPUTS, in one pass; without gradients and skew.

        Of several functions each has a channel of its own, or a mask: extinctions add up, and colours are
        means that these weigh.

        Samples stay where they are without a depth range, and count for what of their step lies in it: two
        parts of a ray join. Over an opacity unit behind the faces of a cut, normals are those of its planes,
        as even matter has none; or, where faces are not to be lit, colours are those of the function.

        By cell, rays pass by all cells in which nothing shows, which are found once a function. Otherwise
        they know bricks only: faster for a function that is shown in one small picture.

        Cells say how much of the light reaches samples, as far as the light casts shadows.
        """
        height, width = camera.height, camera.width
        require_memory(
            BYTES_PER_PIXEL * height * width, f"a view of {width} x {height} pixels", "choose a smaller one"
        )
        self._check(camera, outputs)
        tfs = [tf] if isinstance(tf, TransferFunction) else [*tf]
        _, prepared, _kept = self._prepare(tfs, by_cell)
        matrices = [x.float().to(self.device).contiguous() for x in (camera.viewmat, camera.K)]
        shapes = {"rgba": (height, width, 4), "normal": (height, width, 3)}
        seen = {
            name: torch.empty(shapes.get(name, (height, width)), device=self.device)
            for name in ("rgba", *outputs)
        }
        look = self._appearance
        view = NativeView(
            *(*matrices, width, height, look.step * self._voxel, look.opacity_unit),
            *map(tuple, directions(camera, light)),
            *(look.ambient, look.diffuse, look.specular, look.shininess),
            **seen,
            **self._cut(camera, depth_range, faces),
            unlit_faces=not lit_faces,
            **({} if cells is None else lit_by(cells, light)),
        )
        native.call("texgs_cast", *prepared, view, device=self.device)
        return Cast(**seen)

    def _cut(self, camera: Camera, depth_range: Tensor | None, faces: CutRange | None) -> dict[str, Any]:
        """Return the cuts of a view as a structure of the library."""
        size, cut = f"{camera.height} {camera.width}", {}
        if depth_range is not None:
            require({"depth_range": (depth_range, f"2 {size}")})
            cut["depth_range"] = depth_range
        if faces is not None:
            check.shape("faces.face", faces.face, size)
            if faces.face.dtype != torch.int32:
                raise ArgumentError(f"faces.face: expected int32, got {faces.face.dtype}")
            require({"faces.normals": (faces.normals, "P 3")})
            cut |= {"face": faces.face, "planes": faces.normals}
        on_device = {name: x.to(self.device).contiguous() for name, x in cut.items()}
        return {**on_device, "n_planes": len(faces.normals) if faces else 0}

    def _check(self, camera: Camera, outputs: Collection[str]) -> None:
        """Refuse cameras, outputs and steps that the library would take for others, or not take."""
        if isinstance(outputs, str) or not {*outputs} <= {*OUTPUTS}:
            raise ArgumentError(f"outputs: expected some of {', '.join(OUTPUTS)}, got {outputs!r}")
        check.constant(viewmat=camera.viewmat, K=camera.K)
        check.finite(viewmat=camera.viewmat, K=camera.K)
        pinhole(camera.viewmat.cpu(), camera.K.cpu())
        samples = self._diagonal / (self._appearance.step * self._voxel)
        if samples > MAX_SAMPLES:
            raise ArgumentError(
                f"step: expected at most {MAX_SAMPLES} samples on a ray, got {samples:.3g}; raise it"
            )

    def _prepare(self, tfs: list[TransferFunction], by_cell: bool) -> Prepared:
        """Return channels with their functions for the library, and the visible cells."""
        if not tfs:
            raise ArgumentError("tf: expected at least one transfer function, got none")
        key, last = (tfs, by_cell), [*self._prepared]  # another thread may prepare others
        prepared = next((each for each in last if each[0] == key), None)
        if prepared is None:
            volumes, transfers, distances, cells = zip(*(self._shown(tf, by_cell) for tf in tfs), strict=True)
            arrays = (NativeVolume * len(tfs))(*volumes), (NativeTransfer * len(tfs))(*transfers)
            nearest = torch.stack(distances).amin(dim=0)
            in_any = reduce(torch.bitwise_or, cells) if by_cell else None
            own = torch.stack(cells) if by_cell and len(tfs) > 1 else None
            kept = volumes, transfers  # arrays of the library do not keep tensors
            prepared = key, (*arrays, len(tfs), nearest, in_any, own), kept
            self._prepared[:] = [prepared, *last[: CACHE_SIZE - 1]]
        return prepared

    def _shown(
        self, tf: TransferFunction, by_cell: bool
    ) -> tuple[native.Struct, native.Struct, Tensor, Tensor | None]:
        """Return a function's channel, the function, how far bricks are from one that it shows, and cells."""
        volume, extremes = self.channel(tf.channel)
        points, mask = points_of(tf).to(self.device), None
        if tf.within is not None:
            mask, of_mask = self.channel(tf.within)
            if mask.type != TYPES.index("uint8"):
                raise ArgumentError(
                    f"within: expected a mask of uint8, got channel {tf.within} of {TYPES[mask.type]}"
                )
            # Bricks outside of the mask are as those without any number.
            extremes = torch.where(of_mask[:, 1:] < HALF, extremes.new_tensor([inf, -inf]), extremes)
        transfer = NativeTransfer(len(points), points, mask.values if mask else None)
        distance = torch.zeros(len(extremes) + PADDING, dtype=torch.uint8, device=self.device)
        native.call("texgs_volume_distance", volume, extremes, transfer, distance, device=self.device)
        cells = None
        if by_cell:
            cells = torch.empty(len(extremes), 2, dtype=torch.int32, device=self.device)
            native.call("texgs_volume_cells", volume, distance, transfer, cells, device=self.device)
        return volume, transfer, distance, cells

    def functions(self, tfs: Sequence[TransferFunction]) -> tuple[tuple[Any, ...], Any]:
        """Return channels, functions, their number and distances of bricks; and what has to be kept."""
        tfs = [*tfs]
        prepared = next((each for each in [*self._prepared] if each[0][0] == tfs), None)
        _, arguments, kept = prepared or self._prepare(tfs, False)
        return arguments[:4], kept

    def channel(self, number: int) -> tuple[native.Struct, Tensor]:
        """Return a channel for the library, and the extremes of its bricks [bricks, 2]."""
        if number not in self._channels:
            grid = self._grid.channel(number)
            values = np.require(grid.values, grid.values.dtype.newbyteorder("="), ["C", "ALIGNED"])
            kind = "uint8" if values.dtype == bool else values.dtype.name
            if kind not in TYPES:
                raise ArgumentError(f"volume: expected samples of {', '.join(TYPES)} or bool, got {kind}")
            samples = bytes_of(values).to(self.device)
            volume = NativeVolume(samples, TYPES.index(kind), grid.dims, tuple(self.half))
            count_bricks = native.function(native.library(self.device.type), "texgs_volume_bricks")
            bricks = count_bricks(volume, (c_int32 * 3)())
            require_memory(17 * bricks, "a volume's bricks", "crop it, or reduce it by dataset.volume.reduce")
            extremes = torch.empty(bricks, 2, device=self.device)
            missing = torch.zeros(1, dtype=torch.int64, device=self.device)
            native.call("texgs_volume_extremes", volume, extremes, missing, device=self.device)
            self._channels[number] = volume, extremes
        return self._channels[number]


def lit_by(cells: LightCells, light: Light) -> dict[str, Any]:
    """Return what a view needs of the light that reaches its samples, by the names of the library."""
    shadows = light.shadows if light.kind == "directional" else 0.0
    strengths = {"shadows": shadows, "occlusion": light.occlusion, "outset": cells.outset}
    return {"light": cells.light, "light_size": cells.size, "light_half": cells.half, **strengths}


def bytes_of(values: NDArray[Any]) -> Tensor:
    """Return an array as bytes [n], not copied: torch has not all types of samples."""
    with warnings.catch_warnings():  # torch dislikes maps of files, which cannot be written
        warnings.simplefilter("ignore", UserWarning)
        return torch.from_numpy(values.reshape(-1).view(np.uint8))


def points_of(tf: TransferFunction) -> Tensor:
    """Return points [n, 5] of value, opacity, red, green and blue, as `texgs_transfer` has them."""
    low, high = tf.opacity[0][0], tf.opacity[-1][0]
    inner = {value for value, *_ in (*tf.opacity, *tf.color) if low < value < high}
    rows = []
    for value in (low, *sorted(inner), high):
        before, at = (
            np.concatenate([limit(table, np.array(value)) for table in (tf.opacity, tf.color)])
            for limit in (left_limit, right_limit)
        )
        is_step = value > low and bool((before != at).any())
        rows += [[value, *before], [value, *at]] if is_step else [[value, *at]]
        if is_step and value == high:
            rows.append(rows[-1])  # the last interval has no width: values at its start have those of its end
    points = torch.tensor(np.array(rows), dtype=torch.float32)
    if not MIN_WIDTH <= points[-1, 0] - points[0, 0] < inf:
        raise ArgumentError(
            "transfer function: expected values that differ in single precision, got "
            f"{low:.9g} to {high:.9g}; scale or shift the data"
        )
    return points
