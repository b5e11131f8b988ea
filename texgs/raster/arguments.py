"""Check the arguments of the rasterizer, and return them dense."""

from collections.abc import Collection, Mapping, Sequence
from math import inf, isfinite
from operator import index, mul

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.errors import ArgumentError, DeviceError
from texgs.raster import native
from texgs.raster.autograd import RasterView, SurfelTensors
from texgs.raster.types import OUTPUTS, Options, Texture, check_primitive

MAX_CHANNELS = 32
TEXTURE_CHANNELS = 3
MAX_TEXELS = 2**24  # of one surfel; the library counts them in float32
MAX_SIDE = 2**20 - 16  # pixels; the library counts tiles of 16 of them in 16 bits
MAX_SKEW = 1e-3  # largest deviation of a camera's axes from a rotation
ROUNDING = 1e-4  # rounding error to expect in inverted or multiplied matrices
BYTES_PER_SURFEL = 192  # least memory: record, footprint, sorting keys, a few tiles
AXES = {
    "means": "N 3",
    "quats": "N 4",
    "scales": "N 2|3",  # surfels or 3D Gaussians
    "opacities": "N",
    "shift": "N 2",
    "features": "N C",
    "base": "N 3",
    "gain": "N",
    "texels": "T 3",
}


CHECKED_SIZES: dict[tuple, dict[str, int]] = {}  # results by all that is checked: loops repeat the same calls
Inputs = Mapping[str, tuple[Tensor | None, str]]  # by name: a tensor, if any, and axes as in `check.shape`


def require(tensors: Inputs, *, constant: Collection[str] = (), cpu: str = "") -> dict[str, int]:
    """Return the sizes of the axes of tensors; require their shapes, float32 and one device.

    `constant` names tensors without a gradient, `cpu` is the reason for refusing other devices.
    """
    given = {name: tensor for name, (tensor, _) in tensors.items() if tensor is not None}
    about = [(x.shape, x.dtype, x.device) for x in given.values() if isinstance(x, Tensor)]
    key = (cpu, *[(name, tensors[name][1]) for name in given], *about)
    if (sizes := CHECKED_SIZES.get(key)) is None:
        sizes = {}
        for name, tensor in given.items():
            sizes |= check.shape(name, tensor, tensors[name][1], **sizes)
        for name, tensor in given.items():
            check.floating(name, tensor)
            if cpu and tensor.device.type != "cpu":
                raise DeviceError(f"{name}: expected a tensor on cpu, got {tensor.device}; {cpu}")
        check.same_device(**given)
        if len(CHECKED_SIZES) > 4096:
            CHECKED_SIZES.clear()
        CHECKED_SIZES[key] = sizes
    check.constant(**{name: given.get(name) for name in constant})
    return sizes


def surfel_tensors(
    geometry: Sequence[Tensor], shift: Tensor | None, features: Tensor | None, texture: Texture | None
) -> SurfelTensors:
    """Check all tensors of surfels or 3D Gaussians; `geometry` is means, quats, scales and opacities."""
    if features is None and texture is None:
        raise ArgumentError("rasterize: expected features, a texture or both, got neither")
    colors = (None, None, None) if texture is None else (texture.base, texture.gain, texture.texels)
    tensors = SurfelTensors._make((*geometry, shift, features, *colors))
    sizes = require({name: (x, AXES[name]) for name, x in tensors._asdict().items()})
    if texture is not None:
        check_texture(texture, sizes["N"])
    if features is not None:
        channels("features", sizes["C"], MAX_CHANNELS - (0 if texture is None else TEXTURE_CHANNELS))
    n = sizes["N"]
    native.require_memory(BYTES_PER_SURFEL * n, tensors.means.device, f"{n} surfels", "choose fewer")
    return SurfelTensors._make(None if x is None else x.contiguous() for x in tensors)


def check_texture(texture: Texture, n: int) -> None:
    """Require a layout for n surfels. Offsets are checked on the CPU only; a GPU would wait."""
    check.shape("texture.texels", texture.texels, "T 3")
    check.shape("texture.sizes", texture.sizes, "N 2", N=n)
    check.shape("texture.offsets", texture.offsets, "N", N=n)
    layout = {"texture.sizes": texture.sizes, "texture.offsets": texture.offsets}
    for (name, x), dtype in zip(layout.items(), (torch.int32, torch.int64), strict=True):
        if x.dtype != dtype:
            raise ArgumentError(f"{name}: expected {dtype}, got {x.dtype}; convert it with .to({dtype})")
    check.same_device(**{"texture.texels": texture.texels}, **layout)
    if n and texture.sizes.device.type == "cpu":
        columns, rows = texture.sizes.unbind(1)
        counts = columns.long() * rows  # [N]
        # An offset beyond the texels is wrong by whatever amount; clamped, the sum cannot overflow.
        ends = texture.offsets.clamp(max=len(texture.texels)) + counts
        _check_range(texture, counts, ends)
        _check_overlap(texture.offsets, ends)


def _check_range(texture: Texture, counts: Tensor, ends: Tensor) -> None:
    smallest, first, end = int(texture.sizes.min()), int(texture.offsets.min()), int(ends.max())
    if smallest < 1 or first < 0 or end > len(texture.texels):
        raise ArgumentError(
            f"texture: expected sizes of at least 1 and textures within the {len(texture.texels)} texels, "
            f"got sizes from {smallest}, offsets from {first} and a last texel at {end - 1}"
        )
    if (most := int(counts.max())) > MAX_TEXELS:
        raise ArgumentError(f"texture.sizes: expected at most 2^24 texels for one surfel, got {most}")


def _check_overlap(offsets: Tensor, ends: Tensor) -> None:
    if bool((offsets[1:] >= ends[:-1]).all()):  # in the order of surfels, as in most atlases
        return
    order = offsets.argsort(stable=True)
    overlaps = (offsets[order][1:] < ends[order][:-1]).nonzero()
    if len(overlaps):
        first, second = order[overlaps[0, 0] :][:2].tolist()
        raise ArgumentError(
            f"texture: expected texels of its own for every surfel, got surfels {first} and {second} "
            f"sharing texel {int(offsets[second])}; give each a copy"
        )


def channels(name: str, n: int, most: int = MAX_CHANNELS) -> None:
    """Require a number of channels that the library can blend."""
    if not 1 <= n <= most:
        raise ArgumentError(f"{name}: expected 1 to {most} channels, got {n}")


def view(
    surfels: SurfelTensors,
    camera: tuple[Tensor, Tensor, Tensor | None, Tensor | None],
    size: tuple[int, int],
    texture: Texture | None,
    outputs: Collection[str],
    options: Options,
) -> RasterView:
    """Check camera and image; `camera` is viewmat, K, background and depth range, `size` (width, height)."""
    viewmat, K, background, depth_range = camera
    constant = {
        "viewmat": (viewmat, "4 4"),
        "K": (K, "3 3"),
        "background": (background, f"{surfels.channels}"),
    }
    require({"means": (surfels.means, "N 3"), **constant}, constant=constant)
    pinhole(viewmat, K)
    if isinstance(outputs, str):
        raise ArgumentError(f"outputs: expected a collection of names, got a string; pass ({outputs!r},)")
    wanted = frozenset(outputs)
    if unknown := sorted(wanted - set(OUTPUTS)):
        raise ArgumentError(f"outputs: expected any of {', '.join(OUTPUTS)}, got {unknown[0]!r}")
    check_primitive(surfels.scales, texture is not None, wanted)
    try:
        width, height = (index(side) for side in size)
    except TypeError:
        raise ArgumentError(f"width, height: expected whole numbers, got {size[0]!r}, {size[1]!r}") from None
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
        raise ArgumentError(f"width, height: expected 1 to {MAX_SIDE} pixels, got {width} x {height}")
    ranges = {"depth_range": (depth_range, f"2 {height} {width}")}
    require({"means": (surfels.means, "N 3"), **ranges}, constant=ranges)
    if options.check_finite:
        check.finite(**surfels._asdict(), **{name: x for name, (x, _) in constant.items()})
    planes = surfels.channels + 3 * len(wanted) + 2
    n_bytes = 4 * planes * width * height
    native.require_memory(n_bytes, surfels.means.device, "the images", "choose smaller ones")
    matrices = (viewmat.detach().contiguous(), K.detach().contiguous())
    layout = (None, None) if texture is None else (texture.sizes, texture.offsets)
    rest = (None if x is None else x.detach().contiguous() for x in (background, *layout, depth_range))
    return RasterView(*matrices, width, height, wanted, options, *rest)


def pinhole(viewmat: Tensor, K: Tensor) -> None:
    """Require the matrix entries that the library assumes. On the CPU only: a GPU would have to wait.

    Focal lengths are positive, there is no skew, and last rows are 0, ..., 0, 1. NaN and infinity pass;
    they have a separate check.
    """
    if K.device.type != "cpu":
        return
    (fx, skew, _), (tilt, fy, _), last_row = K.tolist()
    if fx <= 0 or fy <= 0:
        raise ArgumentError(f"K: expected focal lengths above 0, got K[0, 0] = {fx} and K[1, 1] = {fy}")
    if skew != 0 and isfinite(skew):
        raise ArgumentError(f"K: expected no skew, got K[0, 1] = {skew}")
    *rows, last_row_of_view = viewmat.tolist()
    for name, row in (("K[1, 0] and K[2]", [tilt, *last_row]), ("viewmat[3]", last_row_of_view)):
        errors = [abs(x - wanted) for x, wanted in zip(row, (0, 0, 0, 1), strict=True) if isfinite(x)]
        if max(errors, default=0) > ROUNDING:
            raise ArgumentError(f"{name}: expected 0, 0, 0, 1, got {row}; did you transpose?")
    axes = [row[:3] for row in rows]
    products = [abs(sum(map(mul, a, b)) - (a is b)) for a in axes for b in axes]
    if any(MAX_SKEW < product < inf for product in products):
        raise ArgumentError(f"viewmat: expected a rotation and a shift, got axes {axes}; normalise them")
